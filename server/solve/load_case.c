/* Voxels, supports and nodal loads of a case.
 *
 * Dead loads are the consistent nodal forces of the shape functions, integrated over the surface that the region
 * selects, not over the voxel faces. Their sum is therefore exact on every mesh. */
#include "server/solve/load_case.h"

#include "server/base/vec3.h"
#include "server/mesh/volume/loose_components.h"
#include "server/num/shape_functions.h"
#include "server/sim/core/configuration.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

pal_box_text pal_box_describe(const pal_box *box)
{
    pal_box_text out;
    if (box->all)
        snprintf(out.text, sizeof out.text, "the whole body");
    else
        snprintf(out.text, sizeof out.text, "(%g, %g, %g) .. (%g, %g, %g)", box->low_m[0], box->low_m[1], box->low_m[2],
                 box->high_m[0], box->high_m[1], box->high_m[2]);
    return out;
}

bool pal_box_contains(const pal_box *box, const double x[3], double slack)
{
    for (int c = 0; c < 3 && !box->all; c++)
        if (x[c] < box->low_m[c] - slack || x[c] > box->high_m[c] + slack) return false;
    return true;
}

const pal_problem_material *pal_case_material_at(const pal_problem *problem, const double x[3])
{
    const pal_problem_material *found = NULL;
    for (int k = 0; k < problem->n_material; k++)
        if (pal_box_contains(&problem->material[k].region, x, 0)) found = &problem->material[k];
    return found;
}

const pal_problem_material *pal_case_material_of(const pal_problem *problem, const pal_tets *t, int tet, double x[3])
{
    pal_copy3(x, t->origin_m);
    for (int k = 0; k < 4; k++) pal_axpy3(x, 0.25, t->x + 3 * t->tet[4 * tet + k]);
    return pal_case_material_at(problem, x);
}

double pal_case_tolerance_m(const pal_tets *tets)
{
    return 1e-6 * tets->edge_m;
}

/* Aligns grid planes with the border of the first support (else material) that cuts the body on an axis. A support
 * that ends within a voxel has the error of one moved by up to a voxel. */
static void align(const pal_problem *p, int resolution, const pal_surface *surface, double ahead[3])
{
    double low[3], high[3], longest = 0;
    pal_surface_box(surface, low, high);
    for (int c = 0; c < 3; c++) longest = fmax(longest, high[c] - low[c]);
    double h = longest / resolution;
    for (int c = 0; c < 3; c++) {
        bool found = false;
        ahead[c] = 0;
        for (int k = 0; k < p->n_support + p->n_material && !found; k++) {
            const pal_box *box = k < p->n_support ? &p->support[k].region : &p->material[k - p->n_support].region;
            const double plane[2] = {box->low_m[c], box->high_m[c]};
            for (int side = 0; side < 2 && !found; side++) {
                double x = plane[side] - surface->origin_m[c], t = (x - low[c]) / h;
                found = x > low[c] + 0.01 * h && x < high[c] - 0.01 * h;
                if (found) ahead[c] = fabs(t - round(t)) < 1e-6 ? 0 : ceil(t) - t;
            }
        }
    }
}

/* drops components without a support, as in the preparation of a scene (mesh/volume/loose_components.h) */
static pal_err drop_loose(const pal_problem *p, pal_prepared *mesh, pal_diagnostic *diag)
{
    const pal_tets *tets = &mesh->tets;
    pal_loose_components parts;
    uint8_t *fixed = calloc((size_t)tets->n_node, sizeof *fixed);
    if (!fixed) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory to find what is held");
    for (int i = 0; i < tets->n_node; i++) {
        double x[3];
        pal_add3(x, tets->x + 3 * (size_t)i, tets->origin_m);
        for (int k = 0; k < p->n_support && !fixed[i]; k++)
            /* a surface lies within a voxel of the nodes of those that it cuts */
            fixed[i] = pal_box_contains(&p->support[k].region, x,
                                        p->support[k].has_normal ? tets->edge_m : pal_case_tolerance_m(tets));
    }
    pal_err err = pal_loose_components_drop("problem", fixed, false, mesh, &parts, diag);
    free(fixed);
    return err;
}

pal_err pal_case_voxels(const pal_problem *problem, const pal_surface *surface, const pal_case_voxel_options *how,
                        pal_prepared *out, pal_diagnostic *diag)
{
    pal_voxel_options voxel = {.resolution = how->resolution, .border = true, .min_fill = how->min_fill};
    pal_prepare_report report;
    pal_copy3(voxel.ahead, how->ahead);
    if (how->align) align(problem, how->resolution, surface, voxel.ahead);
    if (how->fill && !(how->min_fill > 0)) {
        PAL_TRY(pal_filled_voxels_make(surface, &voxel, out, &report, diag));
    } else {
        if (!(how->min_fill > 0)) voxel.min_fill = 0.5;
        PAL_TRY(pal_prepared_make(surface, &voxel, out, &report, diag));
    }
    if (report.voxel.n_component == 1) return PAL_ERR_OK;
    pal_err err = drop_loose(problem, out, diag);
    if (err) pal_prepared_free(out);
    return err;
}

pal_err pal_case_supports(const pal_problem *problem, const pal_tets *tets, pal_support_def out[PAL_PROBLEM_REGIONS],
                          pal_diagnostic *diag)
{
    double slack = pal_case_tolerance_m(tets);
    for (int k = 0; k < problem->n_support; k++) {
        const pal_box *box = &problem->support[k].region;
        bool found = false;
        for (int i = 0; i < tets->n_node && !found; i++) {
            double x[3];
            pal_add3(x, tets->x + 3 * i, tets->origin_m);
            found = pal_box_contains(box, x, slack);
        }
        if (!found)
            return PAL_REFUSE(diag, "supports[%d]: no node of the body lies in %s (voxels of %g m)", k,
                              pal_box_describe(box).text, tets->edge_m);
        out[k] = (pal_support_def){.lowest = false};
        pal_sub3(out[k].low_m, box->low_m, tets->origin_m);
        pal_sub3(out[k].high_m, box->high_m, tets->origin_m);
        for (int c = 0; c < 3; c++) out[k].low_m[c] -= slack, out[k].high_m[c] += slack;
    }
    return PAL_ERR_OK;
}

int pal_case_shape_functions(const pal_body *body, int element, const double local[4], double shape[10],
                             const int32_t **node)
{
    int n_corner = body->element ? body->n_corner : PAL_TET_CORNERS;
    *node = (body->element ? body->element : body->tets->tet) + (size_t)n_corner * (size_t)element;
    pal_element_shape(n_corner, local, shape);
    return n_corner;
}

void pal_case_clamp(int n_corner, double local[4])
{
    double sum = 0;
    if (n_corner == PAL_HEX_CORNERS) {
        for (int c = 0; c < 3; c++) local[c] = fmax(-1, fmin(local[c], 1));
        return;
    }
    for (int c = 0; c < 4; c++) sum += local[c] = fmax(0, local[c]);
    for (int c = 0; c < 4; c++) local[c] /= sum;
}

typedef struct job {
    const pal_problem *problem;
    const pal_problem_case *load_case;
    int index;
    const pal_body *body;
    const pal_locate *locate;
    const pal_surface *surface;
    double *f;
    pal_diagnostic *diag;
} job;

static void spread(const job *j, int element, const double local[4], const double force_N[3])
{
    double n[PAL_MAX_CORNERS];
    const int32_t *node;
    int n_corner = pal_case_shape_functions(j->body, element, local, n, &node);
    for (int k = 0; k < n_corner; k++) pal_axpy3(j->f + 3 * node[k], n[k], force_N);
}

/* "load_cases[0].loads[1]" */
typedef struct load_path {
    char text[64];
} load_path;

static load_path path_of(const job *j)
{
    load_path out;
    snprintf(out.text, sizeof out.text, "load_cases[%d].loads[%d]", (int)(j->load_case - j->problem->load_case),
             j->index);
    return out;
}

static pal_err add_traction(const job *j, double *area_m2)
{
    const pal_problem_load *load = &j->load_case->load[j->index];
    const double *origin = j->body->tets->origin_m;
    double low[3], high[3], area = 0, per_area[3];
    pal_quadrature_point *piece = NULL;
    int n_piece = 0;
    char facing[96] = "";
    pal_sub3(low, load->region.low_m, origin);
    pal_sub3(high, load->region.high_m, origin);
    pal_err err =
        pal_locate_surface(j->locate, j->surface, low, high, load->has_normal ? load->normal : NULL, &piece, &n_piece);
    if (err) return pal_diagnostic_set(j->diag, err, "%s: no memory for its surface", path_of(j).text);
    for (int k = 0; k < n_piece; k++) area += piece[k].area_m2;
    if (area_m2) area_m2[j->index] = area;
    if (!(area > 0)) {
        free(piece);
        if (load->has_normal)
            snprintf(facing, sizeof facing, " that faces (%g, %g, %g)", load->normal[0], load->normal[1],
                     load->normal[2]);
        return PAL_REFUSE(j->diag, "%s: the region %s meets no surface%s", path_of(j).text,
                          pal_box_describe(&load->region).text, facing);
    }
    if (load->has_traction)
        pal_copy3(per_area, load->traction_Pa);
    else
        pal_scale3(per_area, 1 / area, load->total_N);
    for (int k = 0; k < n_piece; k++) {
        double force[3];
        pal_scale3(force, piece[k].area_m2, per_area);
        spread(j, piece[k].element, piece[k].local, force);
    }
    free(piece);
    return PAL_ERR_OK;
}

static pal_err add_point(const job *j, const double point_m[3], const double force_N[3])
{
    double x[3], local[4], outside;
    pal_sub3(x, point_m, j->body->tets->origin_m);
    int element = pal_locate_point(j->locate, x, local, &outside);
    if (outside > j->body->edge_m)
        return PAL_REFUSE(j->diag, "%s: the point (%g, %g, %g) lies %g m outside the body, more than a voxel (%g m)",
                          path_of(j).text, point_m[0], point_m[1], point_m[2], outside, j->body->edge_m);
    spread(j, element, local, force_N);
    return PAL_ERR_OK;
}

/* Points of a recorded mesh: nodes of its voxels lie outside of the surface by up to their edge, and so outside of
 * another mesh. */
static void add_points(const job *j)
{
    const pal_problem_load *load = &j->load_case->load[j->index];
    const int n_corner = j->body->element ? j->body->n_corner : PAL_TET_CORNERS;
    for (int i = 0; i < load->n_points; i++) {
        double x[3], local[4];
        pal_sub3(x, load->points_m + 3 * (size_t)i, j->body->tets->origin_m);
        int element = pal_locate_point(j->locate, x, local, NULL);
        pal_case_clamp(n_corner, local);
        spread(j, element, local, load->points_N + 3 * (size_t)i);
    }
}

pal_err pal_case_forces(const pal_problem *problem, const pal_problem_case *load_case, int load, const pal_body *body,
                        const pal_locate *locate, const pal_surface *surface, double *force_N, double *area_m2,
                        pal_diagnostic *diag)
{
    for (int k = 0; k < load_case->n_load; k++) {
        const pal_problem_load *l = &load_case->load[k];
        const job j = {problem, load_case, k, body, locate, surface, force_N, diag};
        if (load >= 0 && k != load) continue;
        if (l->kind == PAL_LOAD_TRACTION) PAL_TRY(add_traction(&j, area_m2));
        if (l->kind == PAL_LOAD_POINT) PAL_TRY(add_point(&j, l->point_m, l->force_N));
        if (l->kind == PAL_LOAD_POINTS) add_points(&j);
        if (l->kind != PAL_LOAD_GRAVITY) continue;
        for (int i = 0; i < body->n_node; i++) pal_axpy3(force_N + 3 * i, body->mass_kg[i], l->gravity_m_s2);
    }
    return PAL_ERR_OK;
}
