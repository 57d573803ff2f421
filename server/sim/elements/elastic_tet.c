/* Elastic tetrahedra: constants at rest, matrices element by element, measures. The kernels are in
 * elastic_tet_kernel.c. */
#include "server/sim/elements/elastic_tet.h"

#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/num/shape_functions.h"

#include <string.h>

static int entries(int n_corner)
{
    return n_corner * (n_corner + 1) / 2;
}

static void make_shape(pal_elastic_tets *t)
{
    for (int g = 0; g < 5; g++) {
        if (t->options.n_corner == 4) {
            for (int c = 0; c < 3; c++) t->shape[g][c + 1][c] = 1, t->shape[g][0][c] = -1;
            continue;
        }
        static const double centre[4] = {0.25, 0.25, 0.25, 0.25};
        pal_tet10_shape(g == PAL_TET_CENTRE ? centre : pal_tet_gauss[g], NULL, t->shape[g]);
    }
}

/* lanes: tet4 in strips, tet10 in their order */
static pal_err make_lanes(pal_elastic_tets *t, pal_build *build)
{
    int n_tet = t->options.n_tet, n_corner = t->options.n_corner;
    size_t n_index = (size_t)n_tet * (size_t)n_corner;
    t->corner = PAL_NEW(build->arena, int32_t, n_index);
    if (!t->corner) return PAL_ERR_MEMORY;
    memcpy(t->corner, t->options.tet, n_index * sizeof *t->corner);
    if (n_corner == 4) {
        pal_body *body = build->body;
        if (!body->node_order)
            PAL_TRY(pal_node_order_make(body->x_rest, body->n_node, body->edge_m, build->arena, &body->node_order));
        t->node_order = body->node_order;
        PAL_TRY(pal_simd_blocks_make(t->node_order, t->corner, n_tet, 4, build->arena, &t->simd_blocks));
        t->place = t->simd_blocks.place;
        t->n_block = t->simd_blocks.n_strip + t->simd_blocks.n_loose;
    } else {
        t->place = PAL_NEW(build->arena, int32_t, n_tet);
        if (!t->place) return PAL_ERR_MEMORY;
        for (int e = 0; e < n_tet; e++) t->place[e] = e;
        t->n_block = (n_tet + PAL_LANES - 1) / PAL_LANES;
    }
    t->owner = PAL_NEW(build->arena, int32_t, t->n_block * PAL_LANES);
    if (!t->owner) return PAL_ERR_MEMORY;
    for (int l = 0; l < t->n_block * PAL_LANES; l++) t->owner[l] = -1;
    for (int e = 0; e < n_tet; e++) t->owner[t->place[e]] = e;
    return PAL_ERR_OK;
}

/* inverse of the edges at rest, and volume; 0 for an element of less than 1e-6 h^3 */
static void take_rest(pal_elastic_tets *t, double edge_m)
{
    for (int e = 0; e < t->options.n_tet; e++) {
        const int32_t *node = t->corner + (size_t)t->options.n_corner * (size_t)e;
        double a[3][3], inverse[3][3];
        for (int c = 0; c < 3; c++) pal_sub3(a[c], t->x_rest + 3 * node[c + 1], t->x_rest + 3 * node[0]);
        for (int c = 0; c < 3; c++) pal_cross3(inverse[c], a[(c + 1) % 3], a[(c + 2) % 3]);
        double det = pal_dot3(a[0], inverse[0]);
        if (!(fabs(det) > 6e-6 * edge_m * edge_m * edge_m)) continue;
        for (int i = 0; i < 9; i++) *pal_lane(t->inverse, 9, t->place[e], i) = inverse[i / 3][i % 3] / det;
        *pal_lane(t->volume_m3, 1, t->place[e], 0) = fabs(det) / 6 * (t->options.fill ? (double)t->options.fill[e] : 1);
    }
}

pal_err pal_elastic_tets_make(const pal_elastic_tets_options *options, pal_build *build, pal_elastic_tets *out)
{
    const pal_body *body = build->body;
    *out =
        (pal_elastic_tets){.options = *options, .n_node = body->n_node, .x_rest = body->x_rest, .edge_m = body->edge_m};
    out->n_point = options->n_corner == 4 ? 1 : 4;
    make_shape(out);
    PAL_TRY(make_lanes(out, build));
    size_t n_lane = (size_t)out->n_block * PAL_LANES;
    int n_keep = options->law == PAL_LAW_NEO_HOOKEAN ? PAL_TET_MODES * out->n_point : 9;
    out->inverse = PAL_NEW(build->arena, double, 9 * n_lane);
    out->volume_m3 = PAL_NEW(build->arena, double, n_lane);
    out->stiff = PAL_NEW(build->arena, double, 2 * n_lane);
    out->rotation = PAL_NEW(build->arena, double, 4 * n_lane);
    out->tangent = PAL_NEW(build->arena, double, (size_t)n_keep *n_lane);
    out->bound = PAL_NEW(build->arena, double, body->n_node);
    out->entry = PAL_NEW(build->arena, int32_t, (size_t)entries(options->n_corner) * (size_t)options->n_tet);
    if (!out->inverse || !out->volume_m3 || !out->stiff || !out->rotation || !out->tangent || !out->bound ||
        !out->entry)
        return PAL_ERR_MEMORY;
    PAL_TRY(pal_elastic_regions_make(build, options->tet, options->n_tet, options->n_corner, 4, &out->parts));
    take_rest(out, body->edge_m);
    pal_elastic_tets_reset(out);
    pal_elastic_tets_material(out, &build->def->material);
    const bool recovers = options->recover && options->law != PAL_LAW_LINEAR;
    return recovers ? pal_tet_recovery_make(out, build) : PAL_ERR_OK;
}

void pal_elastic_tets_reset(pal_elastic_tets *t)
{
    memset(t->rotation, 0, 4 * sizeof(double) * PAL_LANES * (size_t)t->n_block);
    for (int b = 0; b < t->n_block; b++)
        for (int l = 0; l < PAL_LANES; l++) t->rotation[(size_t)b * 4 * PAL_LANES + (size_t)l] = 1;
    t->n_inverted = 0;
    if (t->recovery) pal_recovery_reset(t->recovery);
}

/* dN_a/dl at a Gauss point times m: gradients by X for m = dl/dX */
static void gradients_by(const pal_elastic_tets *t, int point, const double m[9], double g[][3])
{
    for (int a = 0; a < t->options.n_corner; a++)
        for (int i = 0; i < 3; i++) {
            g[a][i] = 0;
            for (int c = 0; c < 3; c++) g[a][i] += t->shape[point][a][c] * m[3 * c + i];
        }
}

static void gradients(const pal_elastic_tets *t, int e, int point, double g[][3])
{
    double inverse[9];
    for (int i = 0; i < 9; i++) inverse[i] = *pal_lane(t->inverse, 9, t->place[e], i);
    gradients_by(t, point, inverse, g);
}

/* |K_ab| <= mu (|g_a.g_b| + |g_a||g_b|) + lambda |g_a||g_b|, whatever the rotation */
static void bound_at_rest(pal_elastic_tets *t, int e, double *bound)
{
    int n = t->options.n_corner;
    double mu, lambda;
    pal_tet_stiffness(t, e, &mu, &lambda);
    mu /= t->n_point, lambda /= t->n_point;
    const int32_t *node = t->corner + (size_t)n * (size_t)e;
    for (int p = 0; p < t->n_point; p++) {
        double g[PAL_TET10_CORNERS][3];
        gradients(t, e, p, g);
        for (int a = 0; a < n; a++)
            for (int b = 0; b < n; b++) {
                double both = pal_norm3(g[a]) * pal_norm3(g[b]);
                bound[node[a]] += mu * (fabs(pal_dot3(g[a], g[b])) + both) + fabs(lambda) * both;
            }
    }
}

void pal_elastic_tets_material(pal_elastic_tets *t, const pal_material *material)
{
    memset(t->bound, 0, sizeof(double) * (size_t)t->n_node);
    for (int e = 0; e < t->options.n_tet; e++) {
        double mu, lambda, volume = *pal_lane(t->volume_m3, 1, t->place[e], 0);
        pal_elastic_regions_lame(&t->parts, material, e, &mu, &lambda);
        *pal_lane(t->stiff, 2, t->place[e], 0) = volume * mu;
        *pal_lane(t->stiff, 2, t->place[e], 1) = volume * lambda;
        bound_at_rest(t, e, t->bound);
    }
    if (!t->recovery) return;
    memcpy(t->whole, t->stiff, 2 * PAL_LANES * sizeof *t->whole * (size_t)t->n_block);
    pal_recovery_refresh(t->recovery);
}

/* K_ab = mu g_a.g_b I + s [F (g_a x g_b)]x + k1 (C g_a)(C g_b)', C = dJ/dF, s = -mu + k1 (J - 1) */
static void bound_neo(const pal_elastic_tets *t, int e, const double *d, double *bound)
{
    int n = t->options.n_corner;
    double mu, lambda;
    pal_tet_stiffness(t, e, &mu, &lambda);
    const double k1 = (mu /= t->n_point) + lambda / t->n_point;
    const int32_t *node = t->corner + (size_t)n * (size_t)e;
    for (int p = 0; p < t->n_point; p++) {
        double g[PAL_TET10_CORNERS][3], cg[PAL_TET10_CORNERS][3], f[9], c[9];
        gradients(t, e, p, g);
        pal_elastic_tets_gradient(t, e, p, d, f);
        pal_cofactor3(f, c);
        double s = fabs(-mu + k1 * (pal_det3(f) - 1));
        for (int a = 0; a < n; a++) pal_mul33(cg[a], c, g[a]);
        for (int a = 0; a < n; a++)
            for (int b = 0; b < n; b++) {
                double cross[3];
                pal_cross3(cross, g[a], g[b]);
                pal_mul33(cross, f, cross);
                bound[node[a]] += mu * fabs(pal_dot3(g[a], g[b])) + s * pal_norm3(cross) +
                                  fabs(k1) * pal_norm3(cg[a]) * pal_norm3(cg[b]);
            }
    }
}

void pal_elastic_tets_bound(pal_elastic_tets *t, const double *d, double *bound_N_m)
{
    if (t->options.law == PAL_LAW_NEO_HOOKEAN)
        for (int e = 0; e < t->options.n_tet; e++) bound_neo(t, e, d, bound_N_m);
    else
        for (int i = 0; i < t->n_node; i++) bound_N_m[i] += t->bound[i];
}

/* index in the pattern of the pairs of corners of every element, once for each pattern */
static void find_entries(pal_elastic_tets *t, const pal_block_matrix *to)
{
    int n = t->options.n_corner;
    for (int e = 0; e < t->options.n_tet; e++) {
        const int32_t *node = t->corner + (size_t)n * (size_t)e;
        int32_t *entry = t->entry + (size_t)entries(n) * (size_t)e;
        for (int a = 0; a < n; a++)
            for (int b = 0; b <= a; b++, entry++)
                *entry = pal_block_matrix_find(to, node[a] > node[b] ? node[a] : node[b],
                                               node[a] > node[b] ? node[b] : node[a]);
    }
    t->entry_row = to->row;
    t->entry_of = to;
}

static void assemble_gradients(const pal_elastic_tets *t, int e, double k, pal_block_matrix *to)
{
    int n = t->options.n_corner;
    const int32_t *entry = t->entry + (size_t)entries(n) * (size_t)e;
    double r[9], g[4][PAL_TET10_CORNERS][3];
    double mu, lambda;
    pal_tet_stiffness(t, e, &mu, &lambda);
    mu = k * mu / t->n_point, lambda = k * lambda / t->n_point;
    const int32_t *node = t->corner + (size_t)n * (size_t)e;
    /* tangent holds D R' */
    for (int c = 0; c < 9; c++) r[c] = *pal_lane(t->tangent, 9, t->place[e], c);
    for (int p = 0; p < t->n_point; p++) gradients_by(t, p, r, g[p]);
    for (int a = 0; a < n; a++)
        for (int b = 0; b <= a; b++) {
            int row = node[a] > node[b] ? a : b, column = a + b - row;
            double *block = to->value + 9 * (size_t)*entry++;
            for (int p = 0; p < t->n_point; p++) {
                const double *gr = g[p][row], *gc = g[p][column];
                double same = mu * pal_dot3(gr, gc);
                for (int i = 0; i < 3; i++)
                    for (int j = 0; j < 3; j++)
                        block[3 * i + j] += (i == j ? same : 0) + mu * gc[i] * gr[j] + lambda * gr[i] * gc[j];
            }
        }
}

/* dP in the frame of u for dF = e_j g' there, contracted with h: block(i, j) = (dP h)_i */
static void modes_block(const double *stretch, const double *same, const double *cross, const double h[3],
                        const double g[3], double block[9])
{
    static const int between[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}}, other[3][3] = {{0, 2, 1}, {2, 0, 0}, {1, 0, 0}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            /* a = dF_jm = g_m: its own entry jm gives same[.] at jm and cross[.] at mj; jj gives stretches at ii */
            double sum = stretch[between[i][j]] * h[i] * g[j];
            if (i == j) {
                for (int m = 0; m < 3; m++)
                    if (m != j) sum += same[other[j][m]] * h[m] * g[m];
            } else
                sum += cross[other[i][j]] * h[j] * g[i];
            block[3 * i + j] = sum;
        }
}

static void assemble_modes(const pal_elastic_tets *t, int e, double k, pal_block_matrix *to)
{
    int n = t->options.n_corner, width = PAL_TET_MODES * t->n_point;
    const int32_t *node = t->corner + (size_t)n * (size_t)e;
    for (int p = 0; p < t->n_point; p++) {
        double m[PAL_TET_MODES], g[PAL_TET10_CORNERS][3];
        const double *u = m;
        const int32_t *entry = t->entry + (size_t)entries(n) * (size_t)e;
        for (int i = 0; i < PAL_TET_MODES; i++) m[i] = *pal_lane(t->tangent, width, t->place[e], PAL_TET_MODES * p + i);
        gradients_by(t, p, m + 9, g);
        for (int a = 0; a < n; a++)
            for (int b = 0; b <= a; b++) {
                int row = node[a] > node[b] ? a : b, column = a + b - row;
                double *at = to->value + 9 * (size_t)*entry++, block[9], half[9];
                modes_block(m + 18, m + 24, m + 27, g[row], g[column], block);
                /* u block u' */
                pal_elastic_mult(half, block, u);
                for (int i = 0; i < 3; i++)
                    for (int j = 0; j < 3; j++)
                        at[3 * i + j] +=
                            k * (u[3 * i] * half[j] + u[3 * i + 1] * half[3 + j] + u[3 * i + 2] * half[6 + j]);
            }
    }
}

void pal_elastic_tets_assemble(pal_elastic_tets *t, double k, pal_block_matrix *to)
{
    if (t->entry_row != to->row || t->entry_of != to) find_entries(t, to);
    for (int e = 0; e < t->options.n_tet; e++) {
        if (*pal_lane(t->volume_m3, 1, t->place[e], 0) <= 0) continue;
        if (t->options.law == PAL_LAW_NEO_HOOKEAN)
            assemble_modes(t, e, k, to);
        else
            assemble_gradients(t, e, k, to);
    }
}

void pal_elastic_tets_rotate(const pal_elastic_tets *t, double *rotation)
{
    for (int e = 0; e < t->options.n_tet; e++) {
        double r[9], weight = *pal_lane(t->stiff, 2, t->place[e], 0);
        pal_elastic_tets_rotation(t, e, r);
        const int32_t *node = t->corner + (size_t)t->options.n_corner * (size_t)e;
        for (int c = 0; c < t->options.n_corner; c++)
            for (int i = 0; i < 9; i++) rotation[9 * node[c] + i] += weight * r[i];
    }
}

/* von Mises of the Cauchy stress P F'/J (neo-Hookean) or of the small-strain stress in current axes, which has the same
 * von Mises as that in the element's; energy density; strain and distortion; modulus. At one Gauss point */
static double field_at(const pal_elastic_tets *t, int e, int point, const double *d, pal_field field)
{
    double volume = *pal_lane(t->volume_m3, 1, t->place[e], 0);
    double mu, lambda;
    pal_tet_whole_stiffness(t, e, &mu, &lambda);
    mu /= volume, lambda /= volume;
    if (field == PAL_FIELD_YOUNG_PA) return pal_lame_young_Pa(mu, lambda);
    double f[9], r[9], p[9], s[9];
    pal_elastic_tets_gradient(t, e, point, d, f);
    if (field == PAL_FIELD_STRAIN) return pal_largest_strain(f);
    if (field == PAL_FIELD_DISTORTION) return pal_det3(f) - 1;
    if (t->options.law == PAL_LAW_NEO_HOOKEAN) {
        if (field == PAL_FIELD_ENERGY_J_M3) return pal_neo_energy(mu, mu + lambda, f);
        pal_neo_stress(mu, mu + lambda, 0, f, p);
        pal_elastic_mult(s, p, f);
        return pal_von_mises(s) / fmax(fabs(pal_det3(f)), 1e-6);
    }
    pal_elastic_tets_rotation(t, e, r);
    double energy = pal_corotational_stress(mu, lambda, f, r, p);
    if (field == PAL_FIELD_ENERGY_J_M3) return energy;
    pal_elastic_mult(s, p, r);
    return pal_von_mises(s);
}

void pal_elastic_tets_measure(pal_elastic_tets *t, const double *d, pal_field field, double *sum, double *volume_m3)
{
    if (!(PAL_ELASTIC_FIELDS >> field & 1)) return;
    int n = t->options.n_corner;
    for (int e = 0; e < t->options.n_tet; e++) {
        double share = *pal_lane(t->volume_m3, 1, t->place[e], 0) / n, value = 0;
        if (share <= 0) continue;
        for (int p = 0; p < t->n_point; p++) value += field_at(t, e, p, d, field) / t->n_point;
        const int32_t *node = t->corner + (size_t)n * (size_t)e;
        for (int c = 0; c < n; c++) {
            sum[node[c]] += share * value;
            volume_m3[node[c]] += share;
        }
    }
}

void pal_elastic_tets_stress(pal_elastic_tets *t, const double *d, pal_stress_take *take, void *user)
{
    static const double centre[4] = {0.25, 0.25, 0.25, 0.25};
    int n = t->options.n_corner;
    double shape[4][10];
    for (int p = 0; p < t->n_point && n == 10; p++) pal_tet10_shape(pal_tet_gauss[p], shape[p], NULL);
    for (int e = 0; e < t->options.n_tet; e++) {
        double volume = *pal_lane(t->volume_m3, 1, t->place[e], 0), f[9], r[9], p[9];
        double mu, lambda;
        if (volume <= 0) continue;
        pal_tet_whole_stiffness(t, e, &mu, &lambda);
        pal_stress_point to = {.element = e,
                               .n_corner = n,
                               .node = t->corner + (size_t)n * (size_t)e,
                               .volume_m3 = volume / t->n_point,
                               .mu_Pa = mu / volume,
                               .lambda_Pa = lambda / volume};
        bool neo = t->options.law == PAL_LAW_NEO_HOOKEAN;
        pal_elastic_tets_rotation(t, e, r);
        for (int k = 0; k < t->n_point; k++) {
            pal_elastic_tets_gradient(t, e, k, d, f);
            if (neo)
                pal_neo_stress(to.mu_Pa, to.mu_Pa + to.lambda_Pa, 0, f, p);
            else
                pal_corotational_stress(to.mu_Pa, to.lambda_Pa, f, r, p);
            pal_elastic_mult(to.stress, p, neo ? f : r);
            to.shape = n == 10 ? shape[k] : centre;
            take(user, &to);
        }
    }
}
