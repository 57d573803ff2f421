/* Kinds of preconditioners. */
#include "server/sim/implicit/preconditioner.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/sim/implicit/tuning.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

const char *pal_precondition_name(pal_precondition kind)
{
    static const char *const name[] = {"auto", "jacobi", "factor", "multigrid", "incomplete"};
    return name[kind];
}

/* ---- load ---- */

/* the voxel hexahedra that are all of K; NULL: there are none, or something else couples nodes as well */
static const pal_elastic_hexes *find_cubes(const pal_system *system)
{
    const pal_elastic_hexes *cubes = NULL;
    if (system->interpolated_system) return NULL;
    for (int i = 0; i < system->n_force; i++) {
        const pal_tangent *tangent = system->force[i].effect->tangent;
        if (!tangent || !tangent->multiply) continue;
        if (cubes || !tangent->cubes) return NULL;
        cubes = tangent->cubes(system->force[i].self);
    }
    return cubes;
}

static pal_err make_pattern(pal_preconditioner *p, const pal_preconditioner *like, pal_arena *arena)
{
    if (!like || !like->blocks.value) return pal_system_pattern(p->system, arena, &p->blocks);
    p->blocks = like->blocks;
    return PAL_ERR_OK;
}

static pal_err analyse(pal_preconditioner *p, const pal_preconditioner *like, pal_arena *arena)
{
    const double before = pal_clock_s();
    PAL_TRY(make_pattern(p, like, arena));
    pal_err err = pal_cholesky_create(&p->blocks, p->system->body->support, &p->factor);
    p->analyse_s = pal_clock_s() - before;
    return err;
}

/* the factor alone: its pattern is made again where it is wanted, and takes no memory of the body where it is not */
static pal_err analyse_apart(pal_preconditioner *p)
{
    pal_arena *arena = pal_arena_create(1 << 20, true);
    pal_err err = arena ? analyse(p, NULL, arena) : PAL_ERR_MEMORY;
    p->blocks = (pal_block_matrix){.n = 0};
    pal_arena_destroy(arena);
    return err;
}

static pal_err make_levels(pal_preconditioner *p, const pal_elastic_hexes *cubes, pal_arena *arena)
{
    p->levels = PAL_NEW(arena, pal_hex_levels, 1);
    return p->levels ? pal_hex_levels_make(p->system->body, cubes, arena, p->levels) : PAL_ERR_MEMORY;
}

static pal_err choose(pal_preconditioner *p, const pal_elastic_hexes *cubes, pal_arena *arena)
{
    const pal_body *body = p->system->body;
    p->kind = PAL_PRECONDITION_FACTOR;
    if (!cubes)
        snprintf(p->reason, sizeof p->reason, "its elements are no voxel hexahedra");
    else if (body->n_node < PAL_MULTIGRID_NODES_MIN)
        snprintf(p->reason, sizeof p->reason, "it has only %d nodes", body->n_node);
    if (p->reason[0]) return PAL_ERR_OK;
    if (body->n_node < PAL_MULTIGRID_NODES) {
        PAL_TRY(analyse_apart(p));
        const double entries = (double)pal_cholesky_nonzeros(p->factor);
        snprintf(p->reason, sizeof p->reason, "its factor has %.1f million entries", 1e-6 * entries);
        if (entries < PAL_FACTOR_ENTRIES) return PAL_ERR_OK;
        pal_cholesky_destroy(p->factor);
        p->factor = NULL, p->analyse_s = 0;
    } else {
        snprintf(p->reason, sizeof p->reason, "its %d nodes are too many for a factor", body->n_node);
    }
    PAL_TRY(make_levels(p, cubes, arena));
    if (p->levels->grid.n_level > 0)
        p->kind = PAL_PRECONDITION_MULTIGRID;
    else
        snprintf(p->reason, sizeof p->reason, "its %d nodes hang together too little for coarser levels", body->n_node);
    return PAL_ERR_OK;
}

static pal_err make_multigrid(pal_preconditioner *p, const pal_elastic_hexes *cubes, const pal_preconditioner *like,
                              pal_arena *arena, pal_diagnostic *diag)
{
    const pal_body *body = p->system->body;
    if (!cubes)
        return PAL_REFUSE(diag, "body \"%s\": a multigrid preconditioner is for voxel hexahedra; take \"factor\"",
                          body->name);
    if (like) p->levels = like->levels, p->shares = true;
    if (!p->levels) PAL_TRY(make_levels(p, cubes, arena));
    if (p->levels->grid.n_level == 0)
        return PAL_REFUSE(diag,
                          "body \"%s\": a multigrid preconditioner needs more than the body's %d nodes; take "
                          "\"factor\"",
                          body->name, body->n_node);
    return pal_hex_multigrid_make(p->levels, !p->shares, arena, &p->multigrid);
}

pal_err pal_preconditioner_make(const pal_preconditioner_options *options, pal_system *system,
                                const pal_node_rotations *rotations, pal_arena *arena, pal_diagnostic *diag,
                                pal_preconditioner *out)
{
    const pal_elastic_hexes *cubes = find_cubes(system);
    const pal_preconditioner *like = options->like;
    const size_t n = (size_t)system->body->n_dof;
    *out = (pal_preconditioner){
        .kind = options->kind, .system = system, .rotations = rotations, .single = options->single};
    if (like) out->kind = like->kind;
    PAL_TRY(pal_warp_make(rotations, arena, &out->warp));
    if (out->kind == PAL_PRECONDITION_AUTO) PAL_TRY(choose(out, cubes, arena));
    const bool multigrid = out->kind == PAL_PRECONDITION_MULTIGRID;
    if (!multigrid && !PAL_NEW_DOUBLES(arena, 3 * n, &out->work)) return PAL_ERR_MEMORY;
    if (!(multigrid && like) && !(out->next = PAL_NEW(arena, float, 4 * n))) return PAL_ERR_MEMORY;
    switch (out->kind) {
    case PAL_PRECONDITION_MULTIGRID:
        return make_multigrid(out, cubes, like, arena, diag);
    case PAL_PRECONDITION_JACOBI:
        PAL_TRY(make_pattern(out, like, arena));
        return PAL_NEW_DOUBLES(arena, 9 * n, &out->inverse) ? PAL_ERR_OK : PAL_ERR_MEMORY;
    case PAL_PRECONDITION_INCOMPLETE:
        PAL_TRY(make_pattern(out, like, arena));
        return pal_incomplete_cholesky_make(&out->blocks, system->body->support, arena, &out->incomplete);
    default:
        return out->factor ? make_pattern(out, like, arena) : analyse(out, like, arena);
    }
}

bool pal_preconditioner_suits_multigrid(const pal_system *system)
{
    return system->body->n_node >= PAL_MULTIGRID_NODES_MIN && find_cubes(system);
}

void pal_preconditioner_destroy(pal_preconditioner *p)
{
    pal_cholesky_destroy(p->factor);
    pal_hex_multigrid_destroy(&p->multigrid);
    p->factor = NULL;
}

/* ---- values ---- */

static pal_err invert_diagonal(pal_preconditioner *p)
{
    const pal_body *body = p->system->body;
    for (int i = 0; i < body->n_dof; i++) {
        const double *a = p->blocks.value + 9 * (size_t)p->blocks.start[i];
        if (body->support[i])
            memset(p->inverse + 9 * i, 0, 9 * sizeof *p->inverse);
        else if (!(pal_inverse33(p->inverse + 9 * i, a) > 0))
            return PAL_ERR_NUMERIC;
    }
    return PAL_ERR_OK;
}

static pal_err update(pal_preconditioner *p, bool pending)
{
    const pal_system *system = p->system;
    if (p->kind == PAL_PRECONDITION_MULTIGRID)
        return pal_hex_multigrid_update(&p->multigrid, system->mass, system->stiff + system->viscous);
    pal_system_assemble(p->system, &p->blocks);
    if (p->kind == PAL_PRECONDITION_JACOBI) return invert_diagonal(p);
    if (p->kind == PAL_PRECONDITION_INCOMPLETE) return pal_incomplete_cholesky_factor(&p->incomplete, &p->blocks);
    /* the factor in the making is the one in use if this one fails */
    if (pending && !pal_cholesky_adopt(p->factor))
        memcpy(p->warp.base, p->next, 4 * sizeof *p->next * (size_t)p->warp.n_dof);
    return pal_cholesky_factor(p->factor, &p->blocks, p->single);
}

pal_err pal_preconditioner_update(pal_preconditioner *p)
{
    const double before = pal_clock_s() - p->system->assemble_s;
    pal_err err = update(p, p->pending);
    p->pending = false, p->left_s = 0;
    p->update_s += pal_clock_s() - p->system->assemble_s - before;
    if (err) return err;
    p->n_update++;
    p->refreshed = p->warp.rotated = false, p->turn_rad = INFINITY;
    pal_warp_keep(p->rotations, p->warp.base);
    return PAL_ERR_OK;
}

void pal_preconditioner_set_rest(pal_preconditioner *p)
{
    pal_warp_rest(p->warp.base, p->warp.n_dof);
}

bool pal_preconditioner_follow(pal_preconditioner *p)
{
    if (p->kind != PAL_PRECONDITION_MULTIGRID || p->shares) return true;
    p->turn_rad += pal_hex_multigrid_rotate(&p->multigrid);
    return p->turn_rad > PAL_TURN_RAD || p->multigrid.now.stiff_nodes.n > 0;
}

void pal_preconditioner_rotate(pal_preconditioner *p)
{
    p->turn_rad = 0;
    if (p->kind != PAL_PRECONDITION_INCOMPLETE) pal_warp_rotate(&p->warp, p->rotations, p->system->body->team);
}

bool pal_preconditioner_refresh(pal_preconditioner *p, bool at_rest)
{
    if (!pal_preconditioner_ready(p) || p->shares) return false;
    double flops;
    if (p->kind == PAL_PRECONDITION_MULTIGRID) {
        if (pal_hex_multigrid_refresh(&p->multigrid, p->system->mass, p->system->stiff + p->system->viscous))
            return false;
        flops = pal_hex_multigrid_flops(&p->multigrid);
    } else if (p->kind == PAL_PRECONDITION_FACTOR) {
        pal_system_assemble(p->system, &p->blocks);
        if (pal_cholesky_refresh(p->factor, &p->blocks)) return false;
        flops = pal_cholesky_flops(p->factor);
    } else {
        return false;
    }
    pal_warp_keep(p->rotations, p->next);
    if (at_rest) pal_warp_rest(p->next, p->warp.n_dof);
    p->pending = true;
    p->left_s = flops / PAL_REFRESH_FLOPS;
    return true;
}

void pal_preconditioner_step(pal_preconditioner *p, double dt_s)
{
    p->left_s -= dt_s;
    if (!p->pending || p->left_s > 0) return;
    p->pending = false, p->left_s = PAL_PAUSE_S;
    if (p->kind == PAL_PRECONDITION_MULTIGRID ? pal_hex_multigrid_adopt(&p->multigrid) : pal_cholesky_adopt(p->factor))
        return;
    memcpy(p->warp.base, p->next, 4 * sizeof *p->next * (size_t)p->warp.n_dof);
    p->n_update++;
    p->refreshed = true, p->turn_rad = INFINITY;
}

/* ---- solves ---- */

static void solve_unturned(pal_preconditioner *p, const double *r, double *z)
{
    switch (p->kind) {
    case PAL_PRECONDITION_INCOMPLETE:
        pal_incomplete_cholesky_solve(&p->incomplete, r, z);
        return;
    case PAL_PRECONDITION_JACOBI:
        for (int i = 0; i < p->warp.n_dof; i++) pal_mul33(z + 3 * i, p->inverse + 9 * i, r + 3 * i);
        return;
    default:
        (void)pal_cholesky_solve(p->factor, r, z);
    }
}

void pal_preconditioner_solve(pal_preconditioner *p, pal_cycle cycle, const double *r, double *z)
{
    if (p->kind == PAL_PRECONDITION_MULTIGRID) {
        pal_hex_multigrid_solve(&p->multigrid, cycle, &p->warp, r, z);
        return;
    }
    if (!p->warp.rotated) {
        solve_unturned(p, r, z);
        return;
    }
    pal_warp_back(&p->warp, r, p->work);
    solve_unturned(p, p->work, z);
    pal_warp_forth(&p->warp, z);
}

void pal_preconditioner_report(const pal_preconditioner *p, pal_solve_report *out)
{
    out->assemble_s = p->system->assemble_s;
    out->preconditioner = pal_precondition_name(p->kind), out->preconditioner_reason = p->reason;
    if (p->factor) out->factor_nonzeros = pal_cholesky_nonzeros(p->factor);
    out->n_factor = p->n_update;
    out->analyse_s = p->analyse_s;
    out->factor_s = p->update_s;
}
