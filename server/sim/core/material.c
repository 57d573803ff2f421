/* Materials of regions and strokes of the brush. */
#include "server/base/vec3.h"
#include "server/num/trilinear.h"
#include "server/sim/core/definition.h"

#include <math.h>
#include <stdio.h>

static bool in_box(const pal_region *r, const double x[3])
{
    for (int c = 0; c < 3; c++)
        if (!(x[c] >= r->low_m[c] && x[c] <= r->high_m[c])) return false;
    return true;
}

/* the voxel around x */
static bool in_label(const pal_region *r, const double x[3])
{
    size_t at = 0, step = 1;
    for (int c = 0; c < 3; c++) {
        double g = floor((x[c] - r->low_m[c]) / r->spacing_m[c] + 0.5);
        if (!(g >= 0 && g < r->n[c])) return false;
        at += step * (size_t)g;
        step *= (size_t)r->n[c];
    }
    return r->label[at] == r->is;
}

/* trilinear between the grid's nodes, the border's values beyond them (paper B section 3.5, erratum B12) */
static double on_grid(const pal_region *r, const double *value, const double x[3])
{
    pal_grid grid = {{r->n[0], r->n[1], r->n[2]},
                     {r->low_m[0], r->low_m[1], r->low_m[2]},
                     {r->high_m[0], r->high_m[1], r->high_m[2]}};
    return pal_trilinear_at(&grid, value, x);
}

void pal_material_overlay(const pal_body_def *def, const pal_material *base, const double x[3], pal_material *out)
{
    *out = *base;
    for (int i = 0; i < def->n_region; i++) {
        const pal_region *r = &def->region[i];
        bool grid = r->kind == PAL_REGION_GRID;
        if (r->kind == PAL_REGION_BOX ? !in_box(r, x) : r->kind == PAL_REGION_LABEL ? !in_label(r, x) : false) continue;
        double young_Pa = grid && r->grid_young_Pa ? on_grid(r, r->grid_young_Pa, x) : r->young_Pa;
        double poisson = grid && r->grid_poisson ? on_grid(r, r->grid_poisson, x) : r->poisson;
        double density = grid && r->grid_density_kg_m3 ? on_grid(r, r->grid_density_kg_m3, x) : r->density_kg_m3;
        if (!isnan(young_Pa)) out->young_Pa = young_Pa;
        if (!isnan(poisson)) out->poisson = fmin(poisson, PAL_POISSON_CLAMP);
        if (!isnan(density)) out->density_kg_m3 = density;
    }
}

void pal_material_at(const pal_body_def *def, const double x[3], pal_material *out)
{
    pal_material_overlay(def, &def->material, x, out);
}

/* ---- strokes ---- */

double pal_stroke_weight(const pal_stroke *stroke, const double x[3])
{
    double r = pal_dist3(x, stroke->at_m) / stroke->radius_m, core = 1 - stroke->softness;
    if (!(r < 1)) return 0;
    if (r <= core) return 1;
    double t = (1 - r) / stroke->softness;
    return t * t * (3 - 2 * t);
}

void pal_material_painted(const pal_body_def *def, const double x[3], pal_material *out)
{
    pal_material_at(def, x, out);
    for (int i = 0; i < def->n_stroke; i++) {
        double w = pal_stroke_weight(&def->stroke[i], x);
        if (w == 0) continue;
        out->young_Pa *= pow(def->stroke[i].young_factor, w);
        out->density_kg_m3 *= pow(def->stroke[i].density_factor, w);
    }
}

pal_err pal_stroke_check(const pal_stroke *s, pal_diagnostic *diag)
{
    for (int c = 0; c < 3; c++)
        if (!(fabs(s->at_m[c]) <= PAL_NUMBER_MAX))
            return PAL_REFUSE(diag, "at_m[%d]: %g, wanted -1e9 to 1e9", c, s->at_m[c]);
    if (!(s->radius_m > 0 && s->radius_m <= PAL_NUMBER_MAX))
        return PAL_REFUSE(diag, "radius_m: %g, wanted more than 0", s->radius_m);
    if (!(s->softness >= 0 && s->softness <= 1)) return PAL_REFUSE(diag, "softness: %g, wanted 0 to 1", s->softness);
    if (!(s->young_factor >= 1 / PAL_FACTOR_MAX && s->young_factor <= PAL_FACTOR_MAX))
        return PAL_REFUSE(diag, "young_factor: %g, wanted 1e-6 to 1e6", s->young_factor);
    if (!(s->density_factor >= 1 / PAL_FACTOR_MAX && s->density_factor <= PAL_FACTOR_MAX))
        return PAL_REFUSE(diag, "density_factor: %g, wanted 1e-6 to 1e6", s->density_factor);
    return PAL_ERR_OK;
}

/* ---- checks ---- */

static pal_err refuse(const pal_body_def *def, int index, pal_diagnostic *diag, const char *key, double value,
                      const char *wanted)
{
    return PAL_REFUSE(diag, "body \"%s\" regions[%d].%s: %g, wanted %s", def->name, index, key, value, wanted);
}

/* a constant, or the values of a grid; NaN: not given */
static pal_err check_number(const pal_body_def *def, int index, const char *key, double constant, const double *grid,
                            double low, double high, pal_diagnostic *diag)
{
    const pal_region *r = &def->region[index];
    char wanted[64];
    snprintf(wanted, sizeof wanted, "a number in [%g, %g]", low, high);
    size_t n = grid ? (size_t)r->n[0] * (size_t)r->n[1] * (size_t)r->n[2] : 0;
    if (!grid && !isnan(constant) && !(constant >= low && constant <= high))
        return refuse(def, index, diag, key, constant, wanted);
    for (size_t i = 0; i < n; i++)
        if (!(grid[i] >= low && grid[i] <= high)) {
            char at[64];
            snprintf(at, sizeof at, "%s[%zu]", key, i);
            return refuse(def, index, diag, at, grid[i], wanted);
        }
    return PAL_ERR_OK;
}

static pal_err check_extent(const pal_body_def *def, int index, pal_diagnostic *diag)
{
    static const char *const axis[] = {"low_m[0]", "low_m[1]", "low_m[2]"};
    const pal_region *r = &def->region[index];
    bool grid = r->kind == PAL_REGION_GRID, label = r->kind == PAL_REGION_LABEL;
    for (int c = 0; c < 3; c++) {
        if (!isfinite(r->low_m[c])) return refuse(def, index, diag, axis[c], r->low_m[c], "a finite number");
        if (!label && !(r->high_m[c] >= r->low_m[c] && isfinite(r->high_m[c])))
            return refuse(def, index, diag, "high_m", r->high_m[c], "a corner above low_m");
        if ((grid || label) && !(r->n[c] >= 1 && r->n[c] <= 4096))
            return refuse(def, index, diag, "n", r->n[c], "1 to 4096 along each axis");
        if (grid && r->n[c] > 1 && !(r->high_m[c] > r->low_m[c]))
            return refuse(def, index, diag, "high_m", r->high_m[c], "a corner above low_m");
        if (label && !(r->spacing_m[c] > 0 && isfinite(r->spacing_m[c])))
            return refuse(def, index, diag, "spacing_m", r->spacing_m[c], "a length above 0");
    }
    if (label && !r->label) return refuse(def, index, diag, "label", 0, "a label volume");
    if (label && !(r->is >= 0 && r->is <= 255)) return refuse(def, index, diag, "is", r->is, "a label of 0 to 255");
    return PAL_ERR_OK;
}

pal_err pal_region_check(const pal_body_def *def, int index, pal_diagnostic *diag)
{
    const pal_region *r = &def->region[index];
    if ((unsigned)r->kind > PAL_REGION_GRID) return refuse(def, index, diag, "kind", r->kind, "box, label or grid");
    PAL_TRY(check_extent(def, index, diag));
    bool grid = r->kind == PAL_REGION_GRID;
    const double *young = grid ? r->grid_young_Pa : NULL, *poisson = grid ? r->grid_poisson : NULL,
                 *density = grid ? r->grid_density_kg_m3 : NULL;
    if (!young && !poisson && !density && isnan(r->young_Pa) && isnan(r->poisson) && isnan(r->density_kg_m3))
        return PAL_REFUSE(diag,
                          "body \"%s\" regions[%d]: gives neither young_Pa, poisson nor "
                          "density_kg_m3",
                          def->name, index);
    PAL_TRY(check_number(def, index, "young_Pa", r->young_Pa, young, PAL_YOUNG_MIN_PA, PAL_YOUNG_MAX_PA, diag));
    PAL_TRY(check_number(def, index, "poisson", r->poisson, poisson, PAL_POISSON_MIN, PAL_POISSON_MAX, diag));
    return check_number(def, index, "density_kg_m3", r->density_kg_m3, density, PAL_DENSITY_MIN_KG_M3,
                        PAL_DENSITY_MAX_KG_M3, diag);
}
