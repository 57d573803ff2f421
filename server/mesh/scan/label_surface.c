/* From a label volume to the smooth closed surface of one label (server/mesh/README.md, scans).
 *
 * A surface that is nearly parallel to the slices is a staircase of terraces one voxel high and many wide, which no
 * small blur removes. Smoothing here is therefore long, and bounded only by the voxels: no vertex moves farther than
 * three quarters of a voxel's extent along its normal (after Gibson's constrained elastic nets, 1998). */
#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/contour.h"
#include "server/mesh/geometry/decimate.h"
#include "server/mesh/geometry/smooth.h"
#include "server/mesh/geometry/tuning.h"
#include "server/mesh/scan/label_volume.h"

#include "server/num/sort.h"

#include <stdio.h>

enum { N_BIN = 1 << 16, MAX_RADIUS = 64 };

typedef struct crop {
    int low[3], n[3]; /* voxels of the volume [low, low + n), one layer of others around the label */
    size_t n_voxel;
    uint8_t *mask; /* 1: the label                     [n2][n1][n0] */
    int64_t n_label;
} crop;

typedef struct blurred {
    int n[3];
    double from_m[12]; /* metres -> index into value       */
    double level;      /* subtracted from value            */
    float *value;      /*                      [n2][n1][n0] */
} blurred;

static double determinant(const double m[12])
{
    double cross[3];
    pal_cross3(cross, m + 4, m + 8);
    return pal_dot3(m, cross);
}

typedef struct tally {
    int32_t label;
    int64_t n; /* 0: free slot */
} tally;

static int tally_order(const void *a, const void *b)
{
    const tally *s = a, *t = b;
    return s->n != t->n ? PAL_COMPARE(t->n, s->n) : PAL_COMPARE(s->label, t->label);
}

static tally *tally_slot(tally *table, size_t n_slot, int32_t label)
{
    size_t k = (uint32_t)label * 0x9E3779B9u & (n_slot - 1);
    while (table[k].n && table[k].label != label) k = (k + 1) & (n_slot - 1);
    return &table[k];
}

/* counts of all labels but 0, most frequent first; NULL: no memory */
static tally *count_labels(const pal_label_volume *volume, size_t *n_out)
{
    size_t n_voxel = (size_t)volume->n[0] * (size_t)volume->n[1] * (size_t)volume->n[2], n_slot = 256, n = 0;
    tally *table = calloc(n_slot, sizeof *table);
    for (size_t i = 0, end; table && i < n_voxel; i = end) {
        int32_t label = volume->label[i];
        for (end = i + 1; end < n_voxel && volume->label[end] == label; end++) {
        }
        if (label == 0) continue;
        tally *slot = tally_slot(table, n_slot, label);
        if (slot->n == 0) n++;
        slot->label = label;
        slot->n += (int64_t)(end - i);
        if (2 * n < n_slot) continue;
        tally *larger = calloc(2 * n_slot, sizeof *larger);
        for (size_t k = 0; larger && k < n_slot; k++)
            if (table[k].n) *tally_slot(larger, 2 * n_slot, table[k].label) = table[k];
        free(table);
        table = larger;
        n_slot *= 2;
    }
    if (table) qsort(table, n_slot, sizeof *table, tally_order);
    *n_out = n;
    return table;
}

int pal_label_volume_list(const pal_label_volume *volume, pal_label_count *out, int cap)
{
    size_t n;
    tally *table = count_labels(volume, &n);
    if (!table) return 0;
    double voxel = fabs(determinant(volume->to_m));
    int n_out = n < (size_t)cap ? (int)n : cap;
    for (int i = 0; i < n_out; i++) out[i] = (pal_label_count){table[i].label, table[i].n, (double)table[i].n * voxel};
    free(table);
    return n_out;
}

static pal_err refuse_label(const pal_label_volume *volume, int32_t label, pal_diagnostic *diag)
{
    pal_label_count list[8];
    char text[320] = "";
    int n = pal_label_volume_list(volume, list, 8), used = 0;
    for (int i = 0; i < n; i++)
        used += snprintf(text + used, sizeof text - (size_t)used, "%s%d (%.3g ml)", i ? ", " : "", list[i].label,
                         1e6 * list[i].volume_m3);
    return PAL_REFUSE(diag, "label %d is not in the scan, %s%s", label,
                      n ? "the largest there are " : "which holds no label at all", text);
}

/* the label's box with one voxel of room, and its mask */
static pal_err crop_label(const pal_label_volume *volume, int32_t label, crop *c, pal_diagnostic *diag)
{
    const int *n = volume->n;
    int low[3] = {n[0], n[1], n[2]}, high[3] = {-1, -1, -1};
    const int32_t *v = volume->label;
    for (int z = 0; z < n[2]; z++)
        for (int y = 0; y < n[1]; y++, v += n[0]) {
            int first = 0, last = n[0] - 1;
            while (first < n[0] && v[first] != label) first++;
            if (first == n[0]) continue;
            while (v[last] != label) last--;
            const int at[3] = {first, y, z}, to[3] = {last, y, z};
            for (int a = 0; a < 3; a++) {
                if (at[a] < low[a]) low[a] = at[a];
                if (to[a] > high[a]) high[a] = to[a];
            }
        }
    if (high[0] < 0 || label == 0) return refuse_label(volume, label, diag);
    c->n_voxel = 1;
    for (int a = 0; a < 3; a++) {
        c->low[a] = low[a] - 1;
        c->n[a] = high[a] - low[a] + 3;
        c->n_voxel *= (size_t)c->n[a];
    }
    c->mask = calloc(c->n_voxel, 1);
    if (!c->mask) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a mask of %zu voxels", c->n_voxel);
    for (int z = low[2]; z <= high[2]; z++)
        for (int y = low[1]; y <= high[1]; y++) {
            const int32_t *row = volume->label + ((size_t)z * (size_t)n[1] + (size_t)y) * (size_t)n[0];
            uint8_t *m =
                c->mask + ((size_t)(z - c->low[2]) * (size_t)c->n[1] + (size_t)(y - c->low[1])) * (size_t)c->n[0];
            for (int x = low[0]; x <= high[0]; x++) {
                m[x - c->low[0]] = row[x] == label;
                c->n_label += row[x] == label;
            }
        }
    return PAL_ERR_OK;
}

/* relabels the 6-connected part of value `from` at seed as `to`; stack [n_voxel] of indices; number of voxels */
static int64_t flood(const crop *c, int32_t seed, uint8_t from, uint8_t to, int32_t *stack)
{
    int32_t step[3] = {1, c->n[0], c->n[0] * c->n[1]};
    int64_t count = 1, n = 1;
    stack[0] = seed;
    c->mask[seed] = to;
    while (n > 0) {
        int32_t i = stack[--n];
        int at[3] = {i % c->n[0], i / c->n[0] % c->n[1], i / step[2]};
        for (int k = 0; k < 6; k++) {
            int a = k / 2, side = k % 2 ? 1 : -1;
            if (at[a] + side < 0 || at[a] + side >= c->n[a]) continue;
            int32_t j = i + side * step[a];
            if (c->mask[j] != from) continue;
            c->mask[j] = to;
            stack[n++] = j;
            count++;
        }
    }
    return count;
}

/* keeps the largest part and fills its cavities; the box border is empty, so voxel 0 is outside */
static pal_err keep_largest(crop *c, pal_diagnostic *diag)
{
    int32_t *stack = malloc(c->n_voxel * sizeof *stack), best = -1;
    if (!stack) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory to sort %zu voxels", c->n_voxel);
    int64_t max = 0;
    for (size_t i = 0; i < c->n_voxel; i++) {
        if (c->mask[i] != 1) continue;
        int64_t n = flood(c, (int32_t)i, 1, 2, stack);
        if (n > max) max = n, best = (int32_t)i;
    }
    flood(c, best, 2, 3, stack);
    for (size_t i = 0; i < c->n_voxel; i++) c->mask[i] = c->mask[i] == 3;
    flood(c, 0, 0, 2, stack);
    c->n_label = 0;
    for (size_t i = 0; i < c->n_voxel; i++) {
        c->mask[i] = c->mask[i] != 2;
        c->n_label += c->mask[i];
    }
    free(stack);
    return PAL_ERR_OK;
}

/* area of the mask's voxel faces, about one and a half times that of the body */
static double face_area(const crop *c, const double m[12])
{
    double sum = 0;
    size_t step[3] = {1, (size_t)c->n[0], (size_t)c->n[0] * (size_t)c->n[1]};
    for (int a = 0; a < 3; a++) {
        int u = (a + 1) % 3, v = (a + 2) % 3;
        double p[3] = {m[u], m[4 + u], m[8 + u]}, q[3] = {m[v], m[4 + v], m[8 + v]}, r[3];
        pal_cross3(r, p, q);
        int64_t n = 0;
        for (size_t i = 0; i + step[a] < c->n_voxel; i++) n += c->mask[i] != c->mask[i + step[a]];
        sum += (double)n * pal_norm3(r);
    }
    return sum;
}

/* one axis of the Gaussian, from -> to; kernel [2 radius + 1]. The data are blocks of n[axis] rows of `step` values;
 * whole rows are added at once, or, along x, whole shifted blocks */
static void blur_axis(const int n[3], int axis, const float *kernel, int radius, const float *from, float *to)
{
    ptrdiff_t step = 1, n_row = n[axis], n_all = (ptrdiff_t)n[0] * n[1] * n[2];
    for (int a = 0; a < axis; a++) step *= n[a];
    memset(to, 0, (size_t)n_all * sizeof *to);
    for (ptrdiff_t block = 0; block < n_all; block += step * n_row) {
        const float *f = from + block;
        float *t = to + block;
        for (ptrdiff_t k = -radius; step == 1 && k <= radius; k++) {
            ptrdiff_t first = k < 0 ? -k : 0, last = k > 0 ? n_row - k : n_row;
            float w = kernel[k + radius];
            for (ptrdiff_t i = first; i < last; i++) t[i] += w * f[i + k];
        }
        for (ptrdiff_t i = 0; step > 1 && i < n_row; i++)
            for (ptrdiff_t k = -radius; k <= radius; k++) {
                if (i + k < 0 || i + k >= n_row) continue;
                const float *other = f + (i + k) * step;
                float *row = t + i * step, w = kernel[k + radius];
                for (ptrdiff_t j = 0; j < step; j++) row[j] += w * other[j];
            }
    }
}

/* sampled Gaussian of standard deviation sigma (in voxels) with sum 1; its radius */
static int make_kernel(double sigma, float kernel[2 * MAX_RADIUS + 1])
{
    int radius = (int)fmin(ceil(3 * sigma), MAX_RADIUS);
    double sum = 0, weight[2 * MAX_RADIUS + 1];
    for (int k = -radius; k <= radius; k++)
        sum += weight[k + radius] = sigma > 0 ? exp(-k * k / (2 * sigma * sigma)) : k == 0;
    for (int k = 0; k <= 2 * radius; k++) kernel[k] = (float)(weight[k] / sum);
    return radius;
}

/* the value that as many voxels exceed as the label has; for a speck of a few voxels at most half the largest value */
static double level_of(const float *value, size_t n, int64_t n_label)
{
    int64_t *bin = calloc(N_BIN + 1, sizeof *bin), above = 0;
    if (!bin) return 0.5;
    float max = 0;
    for (size_t i = 0; i < n; i++) {
        bin[(int)(fminf(fmaxf(value[i], 0), 1) * N_BIN)]++;
        max = fmaxf(max, value[i]);
    }
    int k = N_BIN;
    while (k > 1 && above + bin[k] < n_label) above += bin[k--];
    double part = bin[k] ? (double)(n_label - above) / (double)bin[k] : 0;
    free(bin);
    double level = (k + 1 - part) / N_BIN;
    return fmin(level, (double)max / 2);
}

/* metres -> voxel index, the inverse of to_m with index zero at voxel `low` */
static void invert(const double m[12], const int low[3], double out[12])
{
    const double axes[9] = {m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]};
    double inverse[9];
    (void)pal_inverse33(inverse, axes);
    for (int r = 0; r < 3; r++) {
        pal_copy3(out + 4 * r, inverse + 3 * r);
        out[4 * r + 3] = -(out[4 * r] * m[3] + out[4 * r + 1] * m[7] + out[4 * r + 2] * m[11]) - low[r];
    }
}

/* the extent of a voxel along each axis, m; returns the largest */
static double axis_lengths(const double m[12], double length[3])
{
    for (int a = 0; a < 3; a++) length[a] = sqrt(m[a] * m[a] + m[4 + a] * m[4 + a] + m[8 + a] * m[8 + a]);
    return fmax(length[0], fmax(length[1], length[2]));
}

/* the mask as a blurred field with a margin in which it falls to zero */
static pal_err blur_mask(const crop *c, const double to_m[12], double sigma_m, blurred *b, pal_diagnostic *diag)
{
    float kernel[3][2 * MAX_RADIUS + 1];
    int radius[3], low[3];
    size_t n = 1;
    double length[3];
    axis_lengths(to_m, length);
    for (int a = 0; a < 3; a++) {
        radius[a] = make_kernel(sigma_m / length[a], kernel[a]);
        low[a] = c->low[a] - radius[a];
        b->n[a] = c->n[a] + 2 * radius[a];
        n *= (size_t)b->n[a];
    }
    if (n > 16 * c->n_voxel + BLUR_SPARE_VOXEL)
        return pal_diagnostic_set(diag, PAL_ERR_BUDGET,
                                  "voxels of %.3g x %.3g x %.3g mm are too unequal to blur by %.3g mm", 1e3 * length[0],
                                  1e3 * length[1], 1e3 * length[2], 1e3 * sigma_m);
    pal_err err = PAL_ERR_OK;
    float *other;
    PAL_ARRAY(&err, other, n);
    PAL_ZEROED(&err, b->value, n);
    if (err) {
        free(other);
        return pal_diagnostic_set(diag, err, "no memory to blur %zu voxels", n);
    }
    const uint8_t *m = c->mask;
    for (int z = 0; z < c->n[2]; z++)
        for (int y = 0; y < c->n[1]; y++) {
            size_t row = ((size_t)(z + radius[2]) * (size_t)b->n[1] + (size_t)(y + radius[1])) * (size_t)b->n[0];
            for (int x = 0; x < c->n[0]; x++) b->value[row + (size_t)(x + radius[0])] = *m++;
        }
    for (int a = 0; a < 3; a++) {
        blur_axis(b->n, a, kernel[a], radius[a], b->value, other);
        float *swap = b->value;
        b->value = other;
        other = swap;
    }
    free(other);
    b->level = level_of(b->value, n, c->n_label);
    invert(to_m, low, b->from_m);
    return PAL_ERR_OK;
}

/* trilinear value less the level; outside the field its border value counts */
static double field_at(const void *self, const double p[3])
{
    const blurred *b = self;
    size_t at[3], step[3];
    double t[3];
    for (int a = 0; a < 3; a++) {
        const double *m = b->from_m + 4 * a;
        double x = m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3], max = b->n[a] - 1;
        x = x > 0 ? x : 0;
        x = x < max ? x : max;
        at[a] = x < max ? (size_t)x : (size_t)max - 1;
        t[a] = x - (double)at[a];
    }
    step[1] = (size_t)b->n[0];
    step[2] = step[1] * (size_t)b->n[1];
    const float *v = b->value + at[2] * step[2] + at[1] * step[1] + at[0];
    double row[4];
    for (size_t k = 0; k < 4; k++) {
        const float *r = v + (k & 1) * step[1] + (k >> 1) * step[2];
        row[k] = (double)r[0] + t[0] * ((double)r[1] - (double)r[0]);
    }
    double near = row[0] + t[1] * (row[1] - row[0]), far = row[2] + t[1] * (row[3] - row[2]);
    return near + t[2] * (far - near) - b->level;
}

/* lattice around the mask: fine enough for the wanted triangles, not finer than the voxels, at most 1.5 coarse voxels
 */
static pal_contour_box box_of(const crop *c, const double m[12], int target_tri)
{
    pal_contour_box box;
    for (int r = 0; r < 3; r++) {
        box.low_m[r] = box.high_m[r] = m[4 * r + 3];
        for (int a = 0; a < 3; a++) {
            /* two voxels of room on every side */
            double first = m[4 * r + a] * (c->low[a] - 2), last = m[4 * r + a] * (c->low[a] + c->n[a] + 1);
            box.low_m[r] += fmin(first, last);
            box.high_m[r] += fmax(first, last);
        }
    }
    double length[3], coarse = axis_lengths(m, length), fine = cbrt(fabs(determinant(m))), wanted = coarse;
    if (target_tri > 0)
        wanted = sqrt(CONTOUR_TRI_PER_SPACING2 * face_area(c, m) / 1.5 / (CONTOUR_SURPLUS * target_tri));
    box.spacing_m = fmax(fmin(wanted, 1.5 * coarse), fine);
    return box;
}

static pal_err keep_largest_component(pal_surface *s)
{
    pal_err err = PAL_ERR_OK;
    int32_t *label;
    int n = 0, best = 0;
    PAL_ARRAY(&err, label, s->n_tri);
    if (!err) err = pal_surface_components(s, label, &n);
    int64_t *count;
    PAL_ZEROED(&err, count, n);
    for (int t = 0; !err && t < s->n_tri; t++) count[label[t]]++;
    for (int k = 1; !err && k < n; k++)
        if (count[k] > count[best]) best = k;
    size_t kept = 0;
    for (size_t t = 0; !err && n > 1 && t < (size_t)s->n_tri; t++)
        if (label[t] == best) memmove(s->tri + 3 * kept++, s->tri + 3 * t, 3 * sizeof *s->tri);
    if (!err && n > 1) s->n_tri = (int)kept;
    return PAL_FREED(err, label, count);
}

/* relaxes every vertex within SMOOTH_MAX_VOXEL of a voxel's extent along its normal */
static pal_err smooth_within_voxels(pal_surface *s, const double m[12], int rounds)
{
    double *normal = malloc((4 * (size_t)s->n_vertex + 4) * sizeof *normal);
    if (!normal) return PAL_ERR_MEMORY;
    double *reach = normal + 3 * (size_t)s->n_vertex;
    pal_surface_normals(s, normal);
    for (size_t i = 0; i < (size_t)s->n_vertex; i++) {
        reach[i] = 0;
        for (int a = 0; a < 3; a++) {
            const double e[3] = {m[a], m[4 + a], m[8 + a]};
            reach[i] = fmax(reach[i], SMOOTH_MAX_VOXEL * fabs(pal_dot3(normal + 3 * i, e)));
        }
    }
    pal_err err = pal_surface_smooth(s, rounds, reach);
    free(normal);
    return err ? err : pal_surface_smooth(s, rounds > 0 ? SMOOTH_LAST_ROUNDS : 0, NULL);
}

/* moves all vertices along their normals until the volume is the wanted one */
static pal_err set_volume(pal_surface *s, double wanted_m3)
{
    double *normal = malloc((3 * (size_t)s->n_vertex + 3) * sizeof *normal);
    if (!normal) return PAL_ERR_MEMORY;
    pal_surface_normals(s, normal);
    for (int round = 0; round < 10; round++) {
        double missing = wanted_m3 - pal_surface_volume(s), move = missing / pal_surface_area(s);
        if (fabs(missing) < 1e-4 * wanted_m3) break;
        for (size_t i = 0; i < 3 * (size_t)s->n_vertex; i++) s->x[i] += move * normal[i];
    }
    free(normal);
    return PAL_ERR_OK;
}

static pal_err shape_surface(pal_surface *s, const double m[12], const pal_label_surface_options *o, double wanted_m3)
{
    if (!o->all_components) PAL_TRY(keep_largest_component(s));
    /* smoothing takes less time on fewer, larger triangles */
    if (o->target_tri > 0) PAL_TRY(pal_surface_decimate(s, 2 * o->target_tri));
    PAL_TRY(smooth_within_voxels(s, m, o->smooth_rounds < 0 ? SMOOTH_ROUNDS : o->smooth_rounds));
    PAL_TRY(pal_surface_decimate(s, o->target_tri > 0 ? o->target_tri : s->n_tri));
    PAL_TRY(set_volume(s, wanted_m3));
    pal_surface_recentre(s);
    return PAL_ERR_OK;
}

pal_err pal_label_volume_surface(const pal_label_volume *volume, int32_t label,
                                 const pal_label_surface_options *options, pal_surface *out, pal_diagnostic *diag)
{
    static const pal_label_surface_options plain = {-1, -1, 0, false};
    const pal_label_surface_options *o = options ? options : &plain;
    crop c = {0};
    blurred b = {0};
    pal_surface s = {0};
    const double *m = volume->to_m;
    double length[3], coarse = axis_lengths(m, length);
    pal_err err = crop_label(volume, label, &c, diag);
    if (!err && !o->all_components) err = keep_largest(&c, diag);
    if (!err) err = blur_mask(&c, m, o->blur_m < 0 ? coarse : o->blur_m, &b, diag);
    if (!err) {
        pal_contour_box box = box_of(&c, m, o->target_tri);
        err = pal_contour(field_at, &b, &box, &s, diag);
        /* a few voxels may fall between the lattice points */
        for (int k = 0; k < 4 && err == PAL_ERR_REFUSED; k++)
            box.spacing_m /= 2, err = pal_contour(field_at, &b, &box, &s, diag);
    }
    PAL_FREE(b.value, c.mask);
    if (!err) {
        err = shape_surface(&s, m, o, (double)c.n_label * fabs(determinant(m)));
        if (err) pal_diagnostic_set(diag, err, "no memory for the surface of label %d", label);
    }
    if (err)
        pal_surface_free(&s);
    else
        *out = s;
    return err;
}
