/* Classification of voxels as inside or outside (server/mesh/README.md, from a surface to voxels): by scanline for a
 * closed surface, or one whose edges all have an even number of triangles; by vote for an open one; by winding where
 * the vote leaves many voxels undecided. */
#include "server/mesh/voxel/voxel_classify.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/box_tree.h"
#include "server/mesh/geometry/tuning.h"
#include "server/mesh/voxel/surface_part.h"

#include <stdlib.h>
#include <string.h>

bool pal_scan_plain(const pal_crossings *crossings, pal_bits *inside)
{
    int32_t first = 0;
    int64_t n_pair = 0, n_flat = 0;
    for (int row = 0; row < crossings->n_row; row++) {
        const pal_crossing *item = crossings->item + crossings->start[row];
        int64_t n = crossings->start[row + 1] - crossings->start[row];
        if (n == 0) continue;
        if (n & 1) return false;
        if (first == 0) first = item[0].sign;
        uint64_t *word = inside->word + (size_t)inside->n_word * (size_t)row;
        for (int64_t i = 0; i < n; i += 2) {
            if (item[i].sign != first || item[i + 1].sign == first) return false;
            pal_bits_set_run(word, item[i].place, item[i + 1].place);
            n_flat += item[i + 1].depth - item[i].depth < PAL_SCAN_ONE / 16;
            n_pair++;
        }
    }
    /* a copy with reversed orientation pairs up with its twin instead of with the far wall */
    return 2 * n_flat <= n_pair;
}

typedef struct decision {
    const pal_surface *surface;
    const pal_voxels *grid;
    pal_scan_surface *scan;
    pal_bits *inside;
    pal_voxel_report *report;
    pal_diagnostic *diag;
    pal_parts parts;
    pal_surface facing; /* the surface with its parts outward and cavities inward; shares x */
    pal_box_tree *tree; /* of facing */
    double max_winding;
    int64_t n_sure, n_claimed; /* see SURE_FRACTION */
} decision;

/* crossings along one axis of the parts, cavities found along the first */
static pal_err scan_parts(decision *d, int axis, pal_crossings *rows)
{
    PAL_TRY(pal_scan_axis(d->scan, d->grid->n, axis, rows));
    pal_err err = axis == 0 ? pal_parts_nest(&d->parts, rows) : PAL_ERR_OK;
    if (err) pal_crossings_free(rows);
    return err;
}

/* calls take for the n crossings of each row along an axis that has any */
static pal_err each_row(decision *d, int axis, uint8_t *vote,
                        void (*take)(decision *d, int axis, uint8_t *vote, pal_parts_work *work, int row,
                                     const pal_crossing *item, int64_t n))
{
    pal_crossings rows;
    PAL_TRY(scan_parts(d, axis, &rows));
    pal_parts_work *work = pal_parts_work_create(&d->parts);
    for (int row = 0; work && row < rows.n_row; row++) {
        int64_t n = rows.start[row + 1] - rows.start[row];
        if (n > 0) take(d, axis, vote, work, row, rows.item + rows.start[row], n);
    }
    pal_err err = work ? PAL_ERR_OK : PAL_ERR_MEMORY;
    pal_parts_work_destroy(work);
    pal_crossings_free(&rows);
    return err;
}

static void fill_row(decision *d, int axis, uint8_t *vote, pal_parts_work *work, int row, const pal_crossing *item,
                     int64_t n)
{
    (void)axis, (void)vote;
    pal_parts_row(&d->parts, work, item, n, pal_bits_set_run,
                  d->inside->word + (size_t)d->inside->n_word * (size_t)row);
}

/* votes of the three axes: low four bits inside, high four abstained; the rest say outside */
typedef struct ballot {
    uint8_t *vote;
    size_t step, first; /* between voxels of the row, and its first voxel */
    int n;
    uint8_t amount;
} ballot;

static void vote_run(void *self, int from, int to)
{
    ballot *b = self;
    for (int k = from; k < to; k++) b->vote[b->first + b->step * (size_t)k] += b->amount;
}

/* An inconsistent row abstains on every voxel that its consistent parts do not claim: it abstains on all, then the
 * claim revokes that */
static void vote_row(decision *d, int axis, uint8_t *vote, pal_parts_work *work, int row, const pal_crossing *item,
                     int64_t n_item)
{
    const int *n = d->grid->n;
    size_t step[3] = {1, (size_t)n[0], (size_t)n[0] * (size_t)n[1]};
    int p = axis == 0 ? 1 : 0, q = axis == 2 ? 1 : 2;
    ballot b = {vote, step[axis], step[p] * (size_t)(row % n[p]) + step[q] * (size_t)(row / n[p]), n[axis], 1};
    if (pal_parts_row(&d->parts, work, item, n_item, vote_run, &b)) return;
    b.amount = 16;
    vote_run(&b, 0, b.n);
    b.amount = (uint8_t)-16;
    pal_parts_row(&d->parts, work, item, n_item, vote_run, &b);
}

/* the surface with its parts oriented, and its tree; parts that have no orientation (Moebius) have no winding number */
static pal_err build_tree(decision *d)
{
    if (d->tree) return PAL_ERR_OK;
    double began = pal_clock_s();
    const pal_scan_surface *scan = d->scan;
    d->facing = *d->surface;
    d->facing.n_tri = 0;
    d->facing.tri = malloc((scan->n_tri ? (size_t)scan->n_tri : 1) * 3 * sizeof *d->facing.tri);
    if (!d->facing.tri) return PAL_ERR_MEMORY;
    for (size_t t = 0; t < (size_t)scan->n_tri; t++) {
        const int32_t *from = scan->tri + 3 * t;
        const pal_part *part = &d->parts.part[scan->part[t]];
        if (!part->coherent) continue;
        bool turn = part->cavity;
        int32_t *to = d->facing.tri + 3 * (size_t)d->facing.n_tri++;
        to[0] = from[0], to[1] = from[turn ? 2 : 1], to[2] = from[turn ? 1 : 2];
    }
    pal_err err = pal_box_tree_create(&d->facing, &d->tree);
    d->report->tree_s += pal_clock_s() - began;
    return err;
}

static void set_inside(decision *d, int x, int y, int z)
{
    pal_bits_row(d->inside, y, z)[x >> 6] |= (uint64_t)1 << (x & 63);
}

static void decide_by_winding(decision *d, int x, int y, int z)
{
    const pal_voxels *g = d->grid;
    double p[3] = {g->low_m[0] + g->edge_m * (x + 0.5), g->low_m[1] + g->edge_m * (y + 0.5),
                   g->low_m[2] + g->edge_m * (z + 0.5)};
    double w = pal_box_tree_winding(d->tree, p);
    if (w > d->max_winding) d->max_winding = w;
    if (w >= 0.5) set_inside(d, x, y, z);
    d->n_sure += w >= SURE_WINDING;
}

/* joint verdict of the three axes */
typedef enum verdict { OUTSIDE, INSIDE, DISPUTED } verdict;

static verdict judge(uint8_t vote)
{
    int in = vote & 15, out = 3 - in - (vote >> 4);
    if (in == 0 && out >= 2) return OUTSIDE;
    if (out == 0 && in >= 2) return INSIDE;
    return DISPUTED;
}

/* one voxel that two axes do not decide */
static void settle(decision *d, uint8_t vote, bool by_winding, int x, int y, int z)
{
    int in = vote & 15, out = 3 - in - (vote >> 4);
    if (by_winding || in == out)
        decide_by_winding(d, x, y, z);
    else if (in > out)
        set_inside(d, x, y, z), d->n_sure++;
}

static pal_err count_votes(decision *d, const uint8_t *vote)
{
    const int *n = d->grid->n;
    size_t n_cell = (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
    int64_t n_inside = 0, n_disputed = 0, n_tie = 0;
    for (size_t i = 0; i < n_cell; i++) {
        if (!vote[i]) continue;
        verdict v = judge(vote[i]);
        n_inside += v == INSIDE;
        n_disputed += v == DISPUTED;
        n_tie += v == DISPUTED && 2 * (vote[i] & 15) == 3 - (vote[i] >> 4);
        d->n_claimed += (vote[i] & 15) >= 2;
    }
    bool by_winding = (double)n_disputed > FEW_DISPUTED * (double)n_inside;
    strcpy(d->report->method, by_winding ? "winding" : "vote");
    d->report->n_disagree = n_disputed;
    d->n_sure = n_inside;
    if (n_tie || (by_winding && n_disputed)) PAL_TRY(build_tree(d));
    const uint8_t *at = vote;
    for (int z = 0; z < n[2]; z++)
        for (int y = 0; y < n[1]; y++)
            for (int x = 0; x < n[0]; x++, at++) {
                if (!*at) continue;
                verdict v = judge(*at);
                if (v == INSIDE) set_inside(d, x, y, z);
                if (v == DISPUTED) settle(d, *at, by_winding, x, y, z);
            }
    return PAL_ERR_OK;
}

static pal_err by_vote(decision *d)
{
    const int *n = d->grid->n;
    uint8_t *vote = calloc((size_t)n[0] * (size_t)n[1] * (size_t)n[2], 1);
    pal_err err = vote ? pal_scan_find_near(d->scan) : PAL_ERR_MEMORY;
    for (int axis = 0; !err && axis < 3; axis++) err = each_row(d, axis, vote, vote_row);
    if (!err) err = count_votes(d, vote);
    free(vote);
    return err;
}

/* every voxel by its winding number */
static pal_err by_winding(decision *d)
{
    pal_crossings rows;
    PAL_TRY(scan_parts(d, 0, &rows));
    pal_crossings_free(&rows);
    PAL_TRY(build_tree(d));
    for (int z = 1; z < d->grid->n[2] - 1; z++)
        for (int y = 1; y < d->grid->n[1] - 1; y++)
            for (int x = 1; x < d->grid->n[0] - 1; x++) decide_by_winding(d, x, y, z);
    strcpy(d->report->method, "winding");
    return PAL_ERR_OK;
}

/* |sum of area normals| over the area */
static double one_sidedness(const decision *d, double *area_out)
{
    double sum[3] = {0}, area = 0;
    for (size_t t = 0; t < (size_t)d->scan->n_tri; t++) {
        const int32_t *c = d->scan->tri + 3 * t;
        const double *x = d->surface->x;
        double normal[3];
        pal_normal3(normal, x + 3 * (size_t)c[0], x + 3 * (size_t)c[1], x + 3 * (size_t)c[2]);
        pal_axpy3(sum, 0.5, normal);
        area += 0.5 * pal_norm3(normal);
    }
    *area_out = area;
    return area > 0 ? pal_norm3(sum) / area : 1;
}

/* volume of the parts, cavities taken off */
static double parts_volume(const decision *d)
{
    double sum = 0, unit = d->grid->edge_m / PAL_SCAN_ONE;
    for (int i = 0; i < d->parts.n; i++)
        sum += d->parts.part[i].cavity ? -d->parts.part[i].volume : d->parts.part[i].volume;
    return sum * unit * unit * unit;
}

/* Does the surface enclose a volume? Reasons against it: 1 no extent (voxel_fill.c), 2 closed but thinner than the
 * voxels, 3 open and enclosing nothing */
static pal_err check_encloses(decision *d, bool open, int resolution)
{
    int64_t n_inside = pal_bits_count(d->inside);
    double area, sided = one_sidedness(d, &area);
    if (open) {
        if (n_inside > 0 && sided <= MAX_ONE_SIDED && (double)d->n_sure >= SURE_FRACTION * (double)n_inside &&
            (double)d->n_sure >= SURE_FRACTION * (double)d->n_claimed)
            return PAL_ERR_OK;
        return PAL_REFUSE(d->diag,
                          "no volume (reason 3): the surface of %d triangles is open and encloses nothing: %.2f of its "
                          "area faces one way (limit %.2f), the largest winding number is %.2f, %lld of %lld voxels "
                          "are inside beyond doubt, two axes claim %lld",
                          d->scan->n_tri, sided, MAX_ONE_SIDED, d->max_winding, (long long)d->n_sure,
                          (long long)n_inside, (long long)d->n_claimed);
    }
    if (n_inside > 0) return PAL_ERR_OK;
    double volume = d->report->surface_volume_m3, thick = area > 0 ? 2 * volume / area : 0;
    double needed = thick > 0 ? ceil(resolution * d->grid->edge_m / thick) : INFINITY;
    if (needed > 1024)
        return PAL_REFUSE(d->diag,
                          "no volume (reason 2): the closed surface of %d triangles encloses %.3g m3, %.3g m thick",
                          d->scan->n_tri, volume, thick);
    return PAL_REFUSE(d->diag,
                      "no volume (reason 2): no centre of a %.3g m voxel lies inside the closed surface, which is "
                      "about %.3g m thick: resolution %d may do",
                      d->grid->edge_m, thick, (int)needed);
}

/* the requested method, or the first that applies */
static pal_err run_method(decision *d, pal_voxel_method method, bool *open)
{
    bool any = method == PAL_VOXELS_CHOOSE;
    pal_crossings rows;
    const double volume = d->scan->closed ? fabs(pal_surface_volume(d->surface)) : 0;
    d->report->surface_volume_m3 = isfinite(volume) ? volume : 0;
    if (d->scan->closed && (any || method == PAL_VOXELS_SCANLINE)) {
        PAL_TRY(pal_scan_axis(d->scan, d->grid->n, 0, &rows));
        bool plain = pal_scan_plain(&rows, d->inside);
        pal_crossings_free(&rows);
        strcpy(d->report->method, "scanline");
        if (plain) return PAL_ERR_OK;
        memset(d->inside->word, 0, pal_bits_words(d->inside) * sizeof *d->inside->word);
    }
    PAL_TRY(pal_parts_find(d->scan, &d->parts));
    pal_err err;
    bool even = d->scan->even;
    if (any ? even : method == PAL_VOXELS_SCANLINE) {
        strcpy(d->report->method, "scanline");
        err = each_row(d, 0, NULL, fill_row);
    } else if (method == PAL_VOXELS_WINDING)
        err = by_winding(d);
    else
        err = by_vote(d);
    /* a requested scanline is trusted even for an open surface */
    *open = !even && strcmp(d->report->method, "scanline") != 0;
    d->report->surface_volume_m3 = parts_volume(d);
    d->report->open = !even;
    return err;
}

pal_err pal_voxels_classify(const pal_surface *surface, const pal_voxel_options *options, const pal_voxels *grid,
                            pal_bits *inside, pal_voxel_report *report, pal_diagnostic *diag)
{
    pal_scan_surface scan;
    PAL_TRY(pal_scan_snap(surface, grid->low_m, grid->edge_m, &scan));
    decision d = {.surface = surface, .grid = grid, .scan = &scan, .inside = inside, .report = report, .diag = diag};
    bool open = false;
    pal_err err = run_method(&d, options->method, &open);
    if (err == PAL_ERR_BUDGET)
        pal_diagnostic_set(diag, err,
                           "the surface of %d triangles crosses the rows of the %d x %d x %d grid too often: noise?",
                           scan.n_tri, grid->n[0], grid->n[1], grid->n[2]);
    if (!err) err = check_encloses(&d, open, options->resolution);
    pal_box_tree_destroy(d.tree);
    free(d.facing.tri);
    pal_parts_free(&d.parts);
    pal_scan_surface_free(&scan);
    return err;
}
