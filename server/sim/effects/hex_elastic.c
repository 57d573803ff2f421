/* Row hex_elastic: elastic voxel hexahedra, one per voxel of the body (elastic_hex.h).
 *
 * Keys: element ("hex8_bbar": mean dilatation, the default | "hex8": full integration), law ("corotational" | "linear"
 * | "neo_hookean"), fill (true: a voxel counts with the share of it that lies inside the surface, at least 0.02),
 * untangle (true: the body runs on its five-tetrahedra split while a corner is turned over, and is straightened when it
 * stays so, elastic_tet.h; not for linear).
 *
 * The tangent is taken at linearise, and with it the decision on untangling; without an implicit solver the decision is
 * taken whenever forces are. */
#include "server/base/clock.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/elements/elastic_hex.h"

#include <string.h>

static pal_err make(pal_item *item, pal_build *build, void **self)
{
    pal_hex_wish wish = {.law = PAL_LAW_COROTATIONAL, .element = PAL_HEX_BBAR, .fill = true, .untangle = true};
    const char *element = "hex8_bbar";
    PAL_TRY(pal_item_text(item, "element", &element, build->note));
    wish.element = strcmp(element, "hex8_bbar") ? PAL_HEX_FULL : PAL_HEX_BBAR;
    if (wish.element == PAL_HEX_FULL && strcmp(element, "hex8"))
        return pal_note_set(build->note, PAL_ERR_REFUSED, "%s.element: \"%s\" is neither hex8_bbar nor hex8",
                            item->path, element);
    PAL_TRY(pal_elastic_law_read(item, &wish.law, build->note));
    PAL_TRY(pal_item_bool(item, "fill", &wish.fill, build->note));
    PAL_TRY(pal_item_bool(item, "untangle", &wish.untangle, build->note));
    PAL_TRY(pal_item_done(item, build->note));
    pal_hex_row *row = PAL_NEW(build->arena, pal_hex_row, 1);
    if (!row) return PAL_ERR_MEMORY;
    *self = row;
    return pal_hex_make(&wish, build, item->path, row);
}

static pal_err run(void *self, pal_step *step)
{
    pal_hex_row *row = self;
    pal_body *body = step->body;
    if (!row->implicit) pal_hex_untangle(row, body);
    body->rescue.n_tangled += row->n_tangled, body->rescue.n_split += row->n_switch;
    row->n_tangled = row->n_switch = 0;
    if (row->tangled) {
        uint64_t before = pal_clock_ns();
        pal_elastic_tets_force(row->split, body->d, body->f);
        body->rescue.ns += pal_clock_ns() - before;
        return PAL_ERR_OK;
    }
    if (pal_kept_at(&row->kept, body->d)) {
        pal_kept_add(&row->kept, body->f);
        return PAL_ERR_OK;
    }
    pal_slots_load(body->slots, body->d);
    if (row->law == PAL_LAW_NEO_HOOKEAN)
        pal_hex_neo_force(row, body->slots);
    else
        pal_hex_corot_force(row, body->slots);
    pal_slots_add(body->slots, body->f);
    return PAL_ERR_OK;
}

static double energy(void *self, const pal_body *body)
{
    pal_hex_row *row = self;
    if (row->tangled) return pal_elastic_tets_energy(row->split, body->d, NULL);
    if (pal_kept_at(&row->kept, body->d)) return row->kept.energy_J;
    pal_slots_load(body->slots, body->d);
    double *forces = pal_kept_open(&row->kept, body->d);
    double sum = row->law == PAL_LAW_NEO_HOOKEAN ? pal_hex_neo_energy(row, body->slots, forces)
                                                 : pal_hex_corot_energy(row, body->slots, forces);
    if (forces) pal_slots_add(body->slots, forces);
    return pal_kept_close(&row->kept, sum);
}

static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    pal_hex_row *row = self;
    if (row->tangled) {
        pal_elastic_tets_bound(row->split, body->d, bound_N_m);
        return;
    }
    if (row->law == PAL_LAW_NEO_HOOKEAN) {
        pal_hex_neo_bound(row, body, bound_N_m);
        return;
    }
    for (int e = 0; e < row->n_hex; e++)
        for (int c = 0; c < 8; c++) bound_N_m[row->hexes->node[8 * e + c]] += row->bound[row->strips.place[e]];
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_note *note)
{
    (void)body, (void)note;
    pal_hex_material(self, to);
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    (void)body;
    pal_hex_reset(self);
}

static bool couple(void *self, pal_cliques *out)
{
    const pal_hex_row *row = self;
    *out = (pal_cliques){.n_item = row->n_hex, .n_corner = 8, .node = row->hexes->node};
    return true;
}

static void linearise(void *self, const pal_body *body)
{
    pal_hex_row *row = self;
    pal_hex_untangle(row, body);
    if (row->implicit && row->split) row->n_switch += pal_elastic_tets_look(row->split, body, row->tangled);
    if (row->tangled) {
        pal_elastic_tets_linearise(row->split, body->d);
        return;
    }
    pal_slots_load(body->slots, body->d);
    if (row->law == PAL_LAW_NEO_HOOKEAN)
        pal_hex_neo_linearise(row, body->slots);
    else
        pal_hex_corot_linearise(row, body->slots);
}

static void multiply(void *self, const pal_body *body, double k, double c, const double *p, double *out)
{
    const pal_hex_row *row = self;
    (void)c;
    if (row->tangled) {
        pal_elastic_tets_multiply(row->split, k, p, out);
        return;
    }
    pal_slots_load(body->slots, p);
    if (row->law == PAL_LAW_NEO_HOOKEAN)
        pal_hex_neo_multiply(row, body->slots, k);
    else
        pal_hex_corot_multiply(row, body->slots, k);
    pal_slots_add(body->slots, out);
}

static void assemble(void *self, const pal_body *body, double k, double c, pal_blocks *to)
{
    pal_hex_row *row = self;
    (void)c, (void)body;
    if (row->tangled)
        pal_elastic_tets_assemble(row->split, k, to);
    else
        pal_hex_assemble(row, k, to);
}

static void rotate(void *self, const pal_body *body, double *turn)
{
    const pal_hex_row *row = self;
    (void)body;
    if (row->tangled)
        pal_elastic_tets_rotate(row->split, turn);
    else
        pal_hex_rotate(row, turn);
}

static void measure(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    pal_hex_row *row = self;
    if (row->tangled)
        pal_elastic_tets_measure(row->split, body->d, field, sum, volume_m3);
    else
        pal_hex_measure(row, body, field, sum, volume_m3);
}

static void stress(void *self, const pal_body *body, pal_stress_take *take, void *user)
{
    pal_hex_row *row = self;
    if (row->tangled)
        pal_elastic_tets_stress(row->split, body->d, take, user);
    else
        pal_hex_stress(row, body, take, user);
}

static const pal_tangent tangent = {
    .couple = couple, .linearise = linearise, .multiply = multiply, .assemble = assemble, .rotate = rotate};

const pal_effect pal_effect_hex_elastic = {.name = "hex_elastic",
                                           .stage = PAL_STAGE_FORCE,
                                           .internal = true,
                                           .make = make,
                                           .run = run,
                                           .energy = energy,
                                           .stiffness = stiffness,
                                           .material = material,
                                           .reset = reset,
                                           .tangent = &tangent,
                                           .measure = measure,
                                           .fields = PAL_ELASTIC_FIELDS,
                                           .stress = stress};
