/* The problem that a recording poses: the recorded body at rest, its supports, and a load case for each touch. */
#include "server/base/vec3.h"
#include "server/calibrate/calibrate_cases.h"
#include "server/sim/core/configuration.h"

#include <stdio.h>
#include <stdlib.h>

static pal_err set_materials(const pal_calibrate_input *input, pal_problem *p, pal_diagnostic *diag)
{
    const pal_material *m = &input->recorded->material;
    const pal_body_def *def = &input->scene->body[input->recorded->body];
    p->material[p->n_material++] = (pal_problem_material){.id = "body",
                                                          .region = {.all = true},
                                                          .young_Pa = m->young_Pa,
                                                          .poisson = m->poisson,
                                                          .density_kg_m3 = m->density_kg_m3};
    for (int c = 0; c < 3; c++) p->material[0].region.low_m[c] = -1e9, p->material[0].region.high_m[c] = 1e9;
    if (def->n_region >= PAL_PROBLEM_REGIONS)
        return PAL_REFUSE(diag, "regions: %d, finite elements of a recording take %d", def->n_region,
                          PAL_PROBLEM_REGIONS - 1);
    for (int k = 0; k < def->n_region; k++) {
        const pal_region *r = &def->region[k];
        pal_problem_material *to = &p->material[p->n_material++];
        if (r->kind != PAL_REGION_BOX)
            return PAL_REFUSE(diag, "regions[%d]: is no box, finite elements of a recording take boxes alone", k);
        *to = p->material[0];
        snprintf(to->id, sizeof to->id, "region %d", k);
        to->region.all = false;
        if (!isnan(r->young_Pa)) to->young_Pa = r->young_Pa;
        if (!isnan(r->poisson)) to->poisson = r->poisson;
        if (!isnan(r->density_kg_m3)) to->density_kg_m3 = r->density_kg_m3;
        pal_add3(to->region.low_m, r->low_m, def->mesh->surface.origin_m);
        pal_add3(to->region.high_m, r->high_m, def->mesh->surface.origin_m);
    }
    return PAL_ERR_OK;
}

static pal_err set_supports(const pal_calibrate_input *input, pal_problem *p, pal_diagnostic *diag)
{
    const int body = input->recorded->body;
    const pal_body_def *def = &input->scene->body[body];
    pal_support_def box;
    for (int k = 0; k < def->n_effect; k++)
        if (pal_support_of_effect(&def->effect[k], &box))
            return PAL_REFUSE(diag,
                              "effects[%d]: holds the body by springs or moves it, a calibration needs parts that "
                              "are fixed",
                              k);
    for (int k = 0; k < def->n_support; k++) {
        box = def->support[k];
        if ((box.lowest || box.rim) && !pal_configuration_support_box(input->scene, body, k, &box))
            return PAL_REFUSE(diag, "supports[%d]: is no box and no lowest part along an axis", k);
        pal_problem_support *to = &p->support[p->n_support++];
        pal_add3(to->region.low_m, box.low_m, def->mesh->surface.origin_m);
        pal_add3(to->region.high_m, box.high_m, def->mesh->surface.origin_m);
    }
    return PAL_ERR_OK;
}

static void set_cases(const pal_recorded_loads *recorded, pal_problem *p)
{
    for (int k = 0; k < recorded->n; k++) {
        const pal_recorded_load *from = &recorded->load[k];
        pal_problem_case *to = &p->load_case[p->n_case++];
        snprintf(to->id, sizeof to->id, "%s", from->id);
        to->n_load = 1;
        to->load[0] = (pal_problem_load){
            .kind = PAL_LOAD_POINTS, .n_points = from->n_point, .points_m = from->x, .points_N = from->force_N};
    }
}

pal_err pal_calibrate_recorded_problem(const pal_calibrate_input *input, pal_problem **out, pal_surface *surface,
                                       pal_diagnostic *diag)
{
    const pal_body_def *def = &input->scene->body[input->recorded->body];
    if (!def->cells && def->mesh->tets.n_node < 1)
        return PAL_REFUSE(diag,
                          "%s: body \"%s\" is a surface without an inside, springs of a solid do not stand for it",
                          input->problem, def->name);
    pal_problem *p = *out = calloc(1, sizeof *p);
    if (!p || pal_surface_copy(&def->mesh->surface, surface))
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for the recorded body");
    snprintf(p->name, sizeof p->name, "%s", input->scene->title[0] ? input->scene->title : input->scene->name);
    snprintf(p->path, sizeof p->path, "%s", input->problem);
    p->unit_m = 1;
    pal_err err = set_materials(input, p, diag);
    if (!err) err = set_supports(input, p, diag);
    if (err) return pal_diagnostic_prefix(diag, err, input->problem);
    set_cases(input->recorded, p);
    return PAL_ERR_OK;
}
