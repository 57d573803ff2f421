/* Preconditioners of implicit systems, A = (system->mass) M + (system->stiff) K without contact, chosen at load:
 *   jacobi:     the inverses of the diagonal's blocks at the last update; nothing to make,
 *   factor:     a Cholesky factor, warped (warp.h); best for small bodies.
 *   multigrid:  hex_multigrid.h; bodies of voxel hexahedra, any number of nodes;
 *   incomplete: an incomplete factor of the present state, in a tenth of the memory of a factor.
 * `auto` takes the factor for small bodies, while it has fewer than 1.5 million entries, and wherever multigrid cannot
 * be had; else multigrid. Jacobi is never chosen: it is for comparison, and for bodies whose elements change faster
 * than levels can be made.
 *
 * When solves need too many iterations, a newer factor or newer levels are made on a spare thread. Deterministic: they
 * take effect after a simulated time that follows from their operation count, never from the clock. Thread: [load] to
 * make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_PRECONDITIONER_H
#define PAL_SIM_IMPLICIT_PRECONDITIONER_H
#include "server/num/cholesky.h"
#include "server/num/conjugate_gradient.h"
#include "server/num/incomplete_cholesky.h"
#include "server/sim/implicit/hex_multigrid.h"

typedef enum pal_precondition {
    PAL_PRECONDITION_AUTO,
    PAL_PRECONDITION_JACOBI,
    PAL_PRECONDITION_FACTOR,
    PAL_PRECONDITION_MULTIGRID,
    PAL_PRECONDITION_INCOMPLETE
} pal_precondition;
const char *pal_precondition_name(pal_precondition kind); /* never NULL [any] */

typedef struct pal_preconditioner {
    pal_precondition kind;
    char reason[120]; /* why `auto` chose it, with numbers; "" where it was asked for */
    pal_system *system;
    const pal_node_rotations *rotations;
    pal_warp warp;
    /* factor and incomplete: pattern of K, values are work space; diagonal blocks alone for jacobi */
    pal_block_matrix blocks;
    pal_cholesky *factor;
    pal_incomplete_cholesky incomplete;
    pal_hex_levels *levels; /* also for further preconditioners of the same body; NULL: none */
    bool shares;            /* the levels are of the one that it is `like`, which sees to their rotations */
    pal_hex_multigrid multigrid;
    double *inverse; /* jacobi [n_dof][9] */
    double *work;    /* [n_dof][3]; NULL: multigrid */
    float *next;     /* quat of those in progress [n_dof][4]; NULL: levels that are shared */
    double turn_rad; /* of the elements since the warp was found, RMS, at most; infinite: it is of another base */
    bool single;     /* the factor is in single precision */
    bool refreshed;  /* factor or levels are newer than the last update */
    bool pending;    /* newer ones are in progress */
    double left_s;   /* simulated time until it takes effect, or until another refresh may start; below 0: now */
    int n_update;    /* factors or levels made since load */
    double analyse_s, update_s;
} pal_preconditioner;

typedef struct pal_preconditioner_options {
    pal_precondition kind;
    bool single;
    /* the same body's preconditioner whose pattern or levels and kind are taken; NULL: none */
    const pal_preconditioner *like;
} pal_preconditioner_options;

/* the body is at rest. REFUSED: the kind does not suit the body; MEMORY. [load] */
pal_err pal_preconditioner_make(const pal_preconditioner_options *options, pal_system *system,
                                const pal_node_rotations *rotations, pal_arena *arena, pal_diagnostic *diag,
                                pal_preconditioner *out);
void pal_preconditioner_destroy(pal_preconditioner *p);
/* true: of a body for which multigrid is faster than a factor whose entries are many; it may still be refused [any] */
bool pal_preconditioner_suits_multigrid(const pal_system *system);

/* takes the system's coefficients and last linearise, at the present rotations; a refresh in progress is dropped.
 * NUMERIC, MEMORY: a factor in use stays; of the other kinds no solve may follow */
pal_err pal_preconditioner_update(pal_preconditioner *p);
/* declares what is in use to be of the body at rest, not at the present rotations */
void pal_preconditioner_set_rest(pal_preconditioner *p);
/* takes the elements' rotations of the last linearise; true: those of nodes are to be found again, and taken. Multigrid
 * has them for its coarse levels alone, which a turn by less than PAL_TURN_RAD hardly changes */
bool pal_preconditioner_follow(pal_preconditioner *p);
void pal_preconditioner_rotate(pal_preconditioner *p); /* to the present rotations of nodes */
/* z ~ A^-1 r; z may be r. cycle: of multigrid; PAL_CYCLE_V where it has to be symmetric */
void pal_preconditioner_solve(pal_preconditioner *p, pal_cycle cycle, const double *r, double *z);
/* the cycle for the next iteration of conjugate gradients. Two sawtooth cycles end most solves of bodies that nothing
 * touches; later ones, and contact, which no cycle knows, leave what one that is not symmetric hardly changes */
static inline pal_cycle pal_preconditioner_cycle(const pal_system *system, const pal_conjugate_gradient *cg)
{
    return cg->n_done < 2 && !system->has_contact && !cg->careful ? PAL_CYCLE_SAWTOOTH : PAL_CYCLE_V;
}

/* true: a refresh may start; false: one is in progress or was recently */
static inline bool pal_preconditioner_ready(const pal_preconditioner *p)
{
    return !p->pending && !(p->left_s > 0);
}
/* starts a factor or levels on a spare thread, of the system as it is or, at_rest, as of rest; false: not ready, levels
 * that are shared, or of another kind */
bool pal_preconditioner_refresh(pal_preconditioner *p, bool at_rest);
/* once per sub-step: adopts what is due, and waits for it if necessary */
void pal_preconditioner_step(pal_preconditioner *p, double dt_s);
/* sets sizes and times of a report */
void pal_preconditioner_report(const pal_preconditioner *p, pal_solve_report *out);
#endif
