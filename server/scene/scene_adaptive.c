/* Bodies of model adaptive_springs: the surface itself, its levels checked once and reported, and the procedural shapes
 * of paper C (Table I, Figs. 8-13) with what holds them. */
#include "server/base/vec3.h"
#include "server/mesh/geometry/decimate.h"
#include "server/mesh/geometry/procedural.h"
#include "server/scene/scene_import.h"
#include "server/scene/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SHEET = 17 }; /* vertices on a side of the sheet of paper C */
static const double sphere_m = 0.05, sheet_m = 0.2;

/* drops the triangles of all pieces but the one of the largest area, and vertices of none */
static pal_err keep_largest(pal_surface *surface, pal_diagnostic *diag)
{
    int n_piece = 0, best = 0, kept = 0;
    int32_t *label = malloc(sizeof *label * (size_t)surface->n_tri);
    pal_err err = label ? pal_surface_components(surface, label, &n_piece) : PAL_ERR_MEMORY;
    double *area = err || n_piece < 2 ? NULL : calloc((size_t)n_piece, sizeof *area);
    if (!err && n_piece > 1 && !area) err = PAL_ERR_MEMORY;
    for (int t = 0; area && t < surface->n_tri; t++) {
        const double *x = surface->x;
        const int32_t *c = surface->tri + 3 * (size_t)t;
        double n[3];
        pal_normal3(n, x + 3 * (size_t)c[0], x + 3 * (size_t)c[1], x + 3 * (size_t)c[2]);
        area[label[t]] += pal_norm3(n);
    }
    for (int k = 1; area && k < n_piece; k++) best = area[k] > area[best] ? k : best;
    for (int t = 0; area && t < surface->n_tri; t++)
        if (label[t] == best) memmove(surface->tri + 3 * (size_t)kept++, surface->tri + 3 * (size_t)t, 12);
    if (area) surface->n_tri = kept;
    free(area);
    free(label);
    pal_surface_report dropped = {0};
    return !err && n_piece > 1 ? pal_surface_clean(surface, 0, &dropped, diag) : err;
}

/* a closed surface whose triangles run clockwise seen from outside is turned */
static void turn_outward(pal_surface *surface)
{
    pal_surface_topology facts;
    if (pal_surface_check(surface, &facts) || !facts.closed || pal_surface_volume(surface) >= 0) return;
    for (int t = 0; t < surface->n_tri; t++) {
        int32_t *c = surface->tri + 3 * (size_t)t, swap = c[1];
        c[1] = c[2], c[2] = swap;
    }
}

pal_err pal_scene_adaptive_prepare(const pal_surface *surface, const pal_surface_scene *options, pal_prepared *out,
                                   pal_diagnostic *diag)
{
    pal_surface own = {0};
    pal_err err = pal_surface_copy(surface, &own);
    if (!err && options->largest_only) err = keep_largest(&own, diag);
    int target = options->target_tri ? options->target_tri : own.n_tri > PAL_MANY_TRI ? PAL_COARSE_TRI : own.n_tri;
    pal_surface_topology facts = {.manifold = false};
    if (!err) err = pal_surface_check(&own, &facts);
    /* what is not manifold keeps its triangles, for the sentence that refuses it */
    if (!err && own.n_tri > target && facts.manifold && facts.oriented) err = pal_surface_decimate(&own, target);
    if (!err) turn_outward(&own);
    if (!err) err = pal_prepared_surface(&own, out);
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "no memory for %d triangles", surface->n_tri);
    pal_surface_free(&own);
    return err;
}

pal_err pal_scene_adaptive_inspect(const pal_surface *surface, const pal_surface_scene *options,
                                   pal_surface_scene_report *report, pal_diagnostic *diag)
{
    pal_levels levels;
    const pal_levels_options wanted = {.n_level = options->n_level ? options->n_level : PAL_ADAPTIVE_LEVELS};
    PAL_TRY(pal_levels_make(surface, &wanted, &levels, diag));
    report->n_level = levels.n_level;
    report->n_piece = levels.n_component;
    report->level_byte = levels.n_byte;
    report->n_open_edge = 0;
    for (int l = 0; l < levels.n_level; l++) {
        report->n_node[l] = levels.n_vertex[l];
        report->n_spring[l] = pal_levels_n_edge(&levels, l);
    }
    for (int32_t e = 0; e < levels.first_edge[1]; e++) report->n_open_edge += levels.edge[e].face[1] < 0;
    report->area_m2 = pal_surface_area(surface);
    report->volume_m3 = levels.closed ? fabs(pal_surface_volume(surface)) : 0;
    report->mass_kg = options->material.density_kg_m3 * report->area_m2 *
                      (options->thickness_m > 0 ? options->thickness_m : PAL_WALL_M);
    pal_levels_free(&levels);
    if (options->inflate_Pa != 0 && report->n_open_edge > 0)
        return PAL_REFUSE(diag, "pressure is asked for, but the surface has %d open edge%s", report->n_open_edge,
                          report->n_open_edge == 1 ? "" : "s");
    return PAL_ERR_OK;
}

pal_err pal_scene_adaptive_defaults(pal_body_def *body, const pal_surface_scene *options,
                                    const pal_surface_scene_report *report, pal_diagnostic *diag)
{
    pal_entry_init(&body->model, "bodies[0].model", "adaptive_springs");
    PAL_TRY(
        pal_entry_put_number(&body->model, "levels", options->n_level ? options->n_level : PAL_ADAPTIVE_LEVELS, diag));
    PAL_TRY(pal_entry_put_number(&body->model, "thickness_m",
                                 options->thickness_m > 0 ? options->thickness_m : PAL_WALL_M, diag));
    pal_entry_init(&body->output, "bodies[0].output", "surface_output");
    if (report->n_open_edge > 0 && !(options->hold > 0)) body->support[0] = (pal_support_def){.rim = true};
    if (options->inflate_Pa == 0) return PAL_ERR_OK;
    pal_config_entry *inflate = &body->effect[body->n_effect++];
    pal_entry_init(inflate, "", "inflate");
    return pal_entry_put_number(inflate, "pressure_Pa", options->inflate_Pa, diag);
}

/* the box around an opening's ring and cap */
static pal_support_def around(const pal_surface *surface, const int32_t ring[PAL_STOMACH_RING], int32_t cap)
{
    pal_support_def box = {.lowest = false};
    pal_box3_empty(box.low_m, box.high_m);
    pal_box3_add(box.low_m, box.high_m, surface->x + 3 * (size_t)cap);
    for (int k = 0; k < PAL_STOMACH_RING; k++) pal_box3_add(box.low_m, box.high_m, surface->x + 3 * (size_t)ring[k]);
    for (int c = 0; c < 3; c++) box.low_m[c] -= PAL_OPENING_M, box.high_m[c] += PAL_OPENING_M;
    return box;
}

static pal_err make_stomach(pal_scene_shape *out)
{
    pal_stomach stomach;
    PAL_TRY(pal_stomach_make(&stomach));
    pal_surface_recentre(&stomach.surface);
    out->title = "Procedural stomach";
    out->support[0] = around(&stomach.surface, stomach.oesophagus, stomach.oesophagus_cap);
    out->support[1] = around(&stomach.surface, stomach.duodenum, stomach.duodenum_cap);
    out->n_support = 2;
    out->up[1] = 1;
    out->surface = stomach.surface;
    return PAL_ERR_OK;
}

pal_err pal_scene_shape_make(const char *name, pal_scene_shape *out, pal_diagnostic *diag)
{
    *out = (pal_scene_shape){.name = name};
    pal_err err;
    if (!strcmp(name, "stomach")) {
        err = make_stomach(out);
    } else if (!strcmp(name, "sphere")) {
        err = pal_sphere_make(sphere_m, &out->surface);
        out->title = "Sphere", out->in_space = true;
    } else if (!strcmp(name, "sheet")) {
        err = pal_sheet_make(SHEET, SHEET, sheet_m, sheet_m, &out->surface, diag);
        out->title = "Sheet of fabric", out->n_support = 1, out->support[0] = (pal_support_def){.rim = true};
    } else {
        return PAL_REFUSE(diag, "there is no shape \"%.40s\": known are organ, stomach, sphere, sheet", name);
    }
    return err ? pal_diagnostic_set(diag, err, "the shape %s: %s", name, pal_err_text(err)) : PAL_ERR_OK;
}
