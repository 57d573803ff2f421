/* Organs as zero sets of about signed distances, in voxels of edge 1 about the origin, contoured, thinned and scaled.
 */
#include "server/mesh/geometry/organ_family.h"

#include "server/base/vec3.h"
#include "server/mesh/geometry/contour.h"
#include "server/mesh/geometry/decimate.h"
#include "server/num/random.h"

#include <stdlib.h>
#include <string.h>

enum { CAPSULES = 5, FOLDS = 12, ISLANDS = 3, LONGEST_TRI = 3000 };
#define PI 3.14159265358979323846
/* voxels: of the lattice, which resolves walls and grooves of one voxel; between an island and the body, so that no
 * border voxels join them */
#define LATTICE    0.5
#define ISLAND_GAP 3.2
/* least modulus over the weight of a column as high as the diagonal: with a quarter of it limbs fold under their
 * weight. Density and gravity of the default scene, N/m^3 */
#define BEARS       20
#define WEIGHT_N_M3 (1000 * 9.81)
#define SMALLEST_M  0.05

typedef struct capsule {
    double from[3], to[3], radius;
} capsule;

/* a groove along the cone dir.n = offset, with waves along `across`; half its width and its walls' as angles */
typedef struct fold {
    double n[3], across[3], offset, wave, half, slope, depth;
} fold;

typedef struct shape {
    uint64_t seed, count; /* random numbers drawn */
    int n_capsule, n_fold, n_island;
    capsule capsule[CAPSULES];
    /* ball or shell: radius 0: none; wall 0: full */
    double radius, wall, axis[3], opening[3], opening_rad;
    fold fold[FOLDS];
    double island[ISLANDS][4]; /* centre, radius */
} shape;

static double draw(shape *s, double low, double high)
{
    return low + (high - low) * pal_random_unit(s->seed, s->count++);
}

static int draw_count(shape *s, int low, int high)
{
    return low + (int)draw(s, 0, high - low + 1);
}

/* on the unit sphere, z >= min_z */
static void draw_direction(shape *s, double min_z, double out[3])
{
    double z = draw(s, min_z, 1), angle = draw(s, 0, 2 * PI), r = sqrt(1 - z * z);
    pal_set3(out, r * cos(angle), r * sin(angle), z);
}

/* ---- the field, positive inside ---- */

static double capsule_field(const capsule *c, const double p[3])
{
    double along[3], from[3];
    pal_sub3(along, c->to, c->from);
    pal_sub3(from, p, c->from);
    double t = fmin(fmax(pal_dot3(from, along) / pal_dot3(along, along), 0), 1);
    pal_axpy3(from, -t, along);
    return c->radius - pal_norm3(from);
}

static double ball_field(const shape *s, const double p[3])
{
    double q[3], dir[3];
    for (int a = 0; a < 3; a++) q[a] = p[a] / s->axis[a];
    double r = pal_norm3(q), field = s->radius - r;
    if (s->wall == 0) return field;
    if (!pal_unit3(dir, q, 1e-9)) return -s->radius;
    double angle = acos(fmin(fmax(pal_dot3(dir, s->opening), -1), 1));
    return fmin(fmin(field, r - (s->radius - s->wall)), (angle - s->opening_rad) * r);
}

static double field(const void *self, const double p[3])
{
    const shape *s = self;
    double max = s->radius > 0 ? ball_field(s, p) : -INFINITY;
    for (int k = 0; k < s->n_capsule; k++) max = fmax(max, capsule_field(&s->capsule[k], p));
    for (int k = 0; k < s->n_island; k++) max = fmax(max, s->island[k][3] - pal_dist3(p, s->island[k]));
    return max;
}

/* Grooves move the vertices of the ball towards its middle, which keeps its genus however grooves cross. */
static void cut_folds(const shape *s, pal_surface *surface)
{
    for (int i = 0; i < surface->n_vertex && s->n_fold > 0; i++) {
        double p[3], dir[3], depth = 0;
        pal_add3(p, surface->x + 3 * (size_t)i, surface->origin_m);
        if (pal_norm3(p) > s->radius + 1 || !pal_unit3(dir, p, 1e-9)) continue; /* an island */
        for (int k = 0; k < s->n_fold; k++) {
            const fold *f = &s->fold[k];
            double off = fabs(pal_dot3(dir, f->n) - f->offset - f->wave * sin(6 * pal_dot3(dir, f->across)));
            depth = fmax(depth, f->depth * fmin(fmax((f->half - off) / f->slope + 1, 0), 1));
        }
        pal_axpy3(surface->x + 3 * (size_t)i, -depth, dir);
    }
}

/* ---- families ---- */

static void make_slender(shape *s)
{
    const double radius = draw(s, 1.5, 2.2), length = radius * draw(s, 8, 30), bend = draw(s, 40, 110) * PI / 180;
    double dir[3], aside[3], at[3] = {0, 0, 0};
    draw_direction(s, cos(50 * PI / 180), dir);
    for (s->n_capsule = 0; s->n_capsule < CAPSULES; s->n_capsule++) {
        capsule *c = &s->capsule[s->n_capsule];
        /* turns towards a random direction across */
        double turn = s->n_capsule == CAPSULES - 1 ? bend : draw(s, 0, 6) * PI / 180, any[3];
        draw_direction(s, -1, any);
        pal_axpy3(any, -pal_dot3(any, dir), dir);
        if (!pal_unit3(aside, any, 1e-6)) pal_set3(aside, 0, 0, 0);
        pal_scale3(dir, cos(turn), dir);
        pal_axpy3(dir, sin(turn), aside);
        c->radius = radius;
        pal_copy3(c->from, at);
        pal_axpy3(at, length / CAPSULES, dir);
        pal_copy3(c->to, at);
    }
}

static void make_branched(shape *s)
{
    double dir[CAPSULES][3];
    const int n = draw_count(s, 2, CAPSULES);
    for (int k = 0; k < n; k++) {
        capsule *c = &s->capsule[s->n_capsule++];
        pal_set3(dir[k], 0, 0, -1);
        /* limbs at least 50 degrees apart, as far as a hundred draws find room */
        for (int round = 0, near = k > 0; near && round < 100; round++) {
            draw_direction(s, -0.3, dir[k]);
            near = false;
            for (int j = 0; j < k; j++) near |= pal_dot3(dir[j], dir[k]) > cos(50 * PI / 180);
        }
        c->radius = draw(s, 1.5, 4);
        pal_set3(c->from, 0, 0, 0);
        pal_scale3(c->to, 4 + c->radius + draw(s, 0, 7), dir[k]);
    }
}

static void make_thin(shape *s)
{
    s->wall = draw(s, 1, 3);
    s->radius = draw(s, 5, 7) + 0.5 * s->wall;
    for (int a = 0; a < 3; a++) s->axis[a] = draw(s, 0.85, 1.2);
    draw_direction(s, 0, s->opening);
    s->opening_rad = draw(s, 20, 40) * PI / 180;
}

static void make_lobed(shape *s)
{
    s->radius = draw(s, 5.5, 7);
    s->n_fold = draw_count(s, 3, FOLDS);
    for (int k = 0; k < s->n_fold; k++) {
        fold *f = &s->fold[k];
        draw_direction(s, -1, f->n);
        draw_direction(s, -1, f->across);
        f->offset = draw(s, -0.6, 0.6), f->wave = draw(s, 0, 0.12);
        f->depth = draw(s, 0.2, 0.45) * s->radius;
        /* half a voxel to one voxel wide at its bottom */
        f->half = 0.5 * draw(s, 0.5, 1) / (s->radius - f->depth);
        f->slope = 0.4 / s->radius;
    }
}

static const struct {
    const char *name;
    void (*make)(shape *s);
    bool hangs; /* under gravity */
} families[] = {{"slender", make_slender, true},
                {"branched", make_branched, true},
                {"thin-walled", make_thin, false},
                {"lobed", make_lobed, true}};
enum { N_FAMILY = sizeof families / sizeof families[0] };

const char *pal_organ_family_name(int index)
{
    return index < N_FAMILY ? families[index].name : NULL;
}

/* ---- islands and surface ---- */

static void add_ball(double low[3], double high[3], const double at[3], double rx, double ry, double rz)
{
    pal_box3_add(low, high, (double[3]){at[0] - rx, at[1] - ry, at[2] - rz});
    pal_box3_add(low, high, (double[3]){at[0] + rx, at[1] + ry, at[2] + rz});
}

static void find_box(const shape *s, double low[3], double high[3])
{
    const double *axis = s->axis, r = s->radius;
    pal_box3_empty(low, high);
    add_ball(low, high, (double[3]){0, 0, 0}, r * axis[0], r * axis[1], r * axis[2]);
    for (int k = 0; k < s->n_capsule; k++) {
        const capsule *c = &s->capsule[k];
        add_ball(low, high, c->from, c->radius, c->radius, c->radius);
        add_ball(low, high, c->to, c->radius, c->radius, c->radius);
    }
    for (int k = 0; k < s->n_island; k++) {
        const double *at = s->island[k];
        add_ball(low, high, at, at[3], at[3], at[3]);
    }
}

/* comes in from far above until the gap to what is there is left */
static void add_island(shape *s)
{
    double low[3], high[3], dir[3], *at = s->island[s->n_island];
    const double radius = cbrt(draw(s, 1, 20) * 3 / (4 * PI));
    find_box(s, low, high);
    draw_direction(s, 0.3, dir);
    for (double far = pal_dist3(low, high); far > 0; far -= 0.25) {
        double next[3];
        for (int a = 0; a < 3; a++) next[a] = 0.5 * (low[a] + high[a]) + far * dir[a];
        if (field(s, next) > -(radius + ISLAND_GAP)) break;
        pal_copy3(at, next);
    }
    at[3] = radius;
    s->n_island++;
}

pal_err pal_organ_name_read(const char *name, int *family, uint64_t *seed, pal_diagnostic *diag)
{
    for (*family = 0; *family < N_FAMILY; ++*family) {
        const char *word = families[*family].name, *number = name + strlen(word) + 1;
        if (strncmp(name, word, strlen(word)) != 0 || name[strlen(word)] != ':') continue;
        if (*number && strlen(number) <= 9 && strspn(number, "0123456789") == strlen(number)) {
            *seed = strtoull(number, NULL, 10);
            return PAL_ERR_OK;
        }
        return PAL_REFUSE(diag, "\"%.40s\": the seed is not a whole number below 1e9", name);
    }
    return PAL_REFUSE(diag, "\"%.40s\" is not FAMILY:SEED with family slender, branched, thin-walled or lobed", name);
}

pal_err pal_organ_generate(const char *name, pal_generated_organ *out, pal_diagnostic *diag)
{
    int family = 0;
    uint64_t seed = 0;
    double low[3], high[3], longest = 0;
    PAL_TRY(pal_organ_name_read(name, &family, &seed, diag));
    shape s = {.seed = seed * N_FAMILY + (uint64_t)family, .axis = {1, 1, 1}};
    *out = (pal_generated_organ){.gravity = seed % 2 == 1, .n_island = draw_count(&s, 0, ISLANDS)};
    out->young_Pa = 1e3 * pow(50, draw(&s, 0, 1));
    out->hold = draw(&s, 0.05, 0.3);
    double diagonal_m = SMALLEST_M * pow(40, draw(&s, 0, 1));
    if (out->gravity) {
        out->young_Pa = fmax(out->young_Pa, BEARS * WEIGHT_N_M3 * SMALLEST_M);
        diagonal_m = fmin(diagonal_m, out->young_Pa / (BEARS * WEIGHT_N_M3));
    }
    out->hangs = out->gravity && families[family].hangs;
    families[family].make(&s);
    for (int k = 0; k < out->n_island; k++) add_island(&s);
    pal_contour_box box = {.spacing_m = LATTICE};
    find_box(&s, box.low_m, box.high_m);
    for (int a = 0; a < 3; a++) box.low_m[a] -= 3 * LATTICE, box.high_m[a] += 3 * LATTICE;
    PAL_TRY(pal_contour(field, &s, &box, &out->surface, diag));
    cut_folds(&s, &out->surface);
    pal_err err = pal_surface_decimate(&out->surface, LONGEST_TRI);
    if (err) {
        pal_surface_free(&out->surface);
        return err;
    }
    pal_surface_recentre(&out->surface);
    pal_set3(out->surface.origin_m, 0, 0, 0);
    pal_surface_box(&out->surface, low, high);
    for (int a = 0; a < 3; a++) longest = fmax(longest, high[a] - low[a]);
    out->resolution = (int)lround(longest);
    const double scale = diagonal_m / pal_dist3(low, high);
    for (int i = 0; i < 3 * out->surface.n_vertex; i++) out->surface.x[i] *= scale;
    return PAL_ERR_OK;
}
