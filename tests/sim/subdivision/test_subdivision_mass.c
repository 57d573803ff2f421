/* The mass matrix of a solid on its control points: against known entries, integrals and refilling. */
#include "tests/check.h"
#include "tests/fixtures/body_sums.h"
#include "tests/fixtures/subdivision_bodies.h"

#include "server/num/envelope.h"

/* blocks of cubic and trilinear elements, pyramids, by name; the last has no subdivision */
enum { KINDS = 4 };
static bool open_kind(solid_test *t, int kind)
{
    if (kind == 0) solid_block(t, 3, 0.1, 0.15);
    if (kind == 1) solid_block(t, 4, 0.1, 0.15);
    if (kind == 2) solid_house(t, 0.1);
    if (kind == 3) solid_block(t, 5, 0.1, 0.05);
    return solid_open(t, (const int[]){2, 1, 2, 0}[kind]);
}

static double sum(const double *a, int n)
{
    double all = 0;
    for (int i = 0; i < n; i++) all += a[i];
    return all;
}

/* entry (i, j), 0 when it is not in the pattern */
static double entry(const pal_mass_operator *m, const double *value, int i, int j)
{
    for (int k = m->start[i]; k < m->start[i + 1]; k++)
        if (m->point[k] == j) return value[k];
    return 0;
}

static void the_sum_of_all_entries_is_the_integral_of_density(void)
{
    for (int kind = 0; kind < KINDS; kind++) {
        solid_test t;
        REQUIRE(open_kind(&t, kind));
        double kg = solid_mass_kg(t.solid);
        CHECK(kg > 0);
        CHECK_NEAR(sum(t.mass.mass_kg, t.mass.n_entry) / kg, 1, 1e-12);
        CHECK_NEAR(sum(t.body.mass_kg, t.body.n_dof) / kg, 1, 1e-12);
        CHECK_NEAR(sum(t.body.node_mass_kg, t.body.n_node) / kg, 1, 1e-12);
        solid_close(&t);
    }
}

static void it_is_symmetric_to_the_bit_and_ascending(void)
{
    for (int kind = 0; kind < KINDS; kind++) {
        solid_test t;
        REQUIRE(open_kind(&t, kind));
        int n_bad = 0, n_unlike = 0;
        for (int i = 0; i < t.mass.n_point; i++) {
            n_bad += entry(&t.mass, t.mass.mass_kg, i, i) <= 0;
            for (int k = t.mass.start[i]; k < t.mass.start[i + 1]; k++) {
                n_bad += k > t.mass.start[i] && t.mass.point[k] <= t.mass.point[k - 1];
                n_unlike += entry(&t.mass, t.mass.mass_kg, t.mass.point[k], i) != t.mass.mass_kg[k];
            }
        }
        CHECK_INT(n_bad, 0);
        CHECK_INT(n_unlike, 0);
        CHECK_INT(t.mass.start[t.mass.n_point], t.mass.n_entry);
        solid_close(&t);
    }
}

static void it_is_positive_definite(void)
{
    for (int kind = 0; kind < KINDS; kind++) {
        solid_test t;
        pal_envelope e;
        REQUIRE(open_kind(&t, kind));
        REQUIRE(!pal_envelope_make(t.mass.n_point, t.mass.start, t.mass.point, 1 << 20, t.arena, &e));
        CHECK_INT(pal_envelope_factor(&e, t.mass.start, t.mass.point, t.mass.mass_kg, NULL), 0);
        solid_close(&t);
    }
}

static void a_unit_translation_gives_the_lumped_masses(void)
{
    for (int kind = 0; kind < KINDS; kind++) {
        solid_test t;
        REQUIRE(open_kind(&t, kind));
        const int n = t.body.n_dof;
        double *p = malloc(sizeof *p * 3 * (size_t)n), *out = malloc(sizeof *out * 3 * (size_t)n), far = 0;
        for (int i = 0; i < 3 * n; i++) p[i] = (const double[]){1, -2, 0.5}[i % 3];
        pal_mass_operator_multiply(&t.mass, 1, 0, NULL, p, out);
        for (int i = 0; i < 3 * n; i++) far = fmax(far, fabs(out[i] - p[i] * t.body.mass_kg[i / 3]));
        CHECK_LE(far, 1e-13 * solid_mass_kg(t.solid));
        free(p), free(out);
        solid_close(&t);
    }
}

/* m/27 (1, 1/2, 1/4, 1/8) by the number of directions in which two corners of a cube differ */
static void a_single_cube_has_the_textbook_matrix(void)
{
    solid_test t;
    solid_block(&t, 1, 0.1, 0);
    REQUIRE(solid_open(&t, 0));
    double kg = solid_mass_kg(t.solid), far = 0;
    CHECK_NEAR(kg, 1e-3 * t.def.material.density_kg_m3, 1e-12);
    for (int i = 0; i < 8; i++)
        for (int j = 0; j < 8; j++) {
            int apart = __builtin_popcount((unsigned)(i ^ j));
            far = fmax(far, fabs(entry(&t.mass, t.mass.mass_kg, i, j) - kg / 27 / (1 << apart)));
        }
    CHECK_LE(far, 1e-15 * kg);
    solid_close(&t);
}

/* int mu |v|^2 of a field of node velocities, point by point */
static double square_of(const solid_test *t, const double *v)
{
    double all = 0;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++)
        for (int e = 0; e < t->solid->elements.n[kind]; e++)
            for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
                const int32_t *node = pal_subdivision_solid_nodes(t->solid, kind, e);
                const int n_node = pal_cell_kind_nodes(kind);
                double at[3], n[64], g[64][3], J[9], here[3] = {0, 0, 0}, weight = pal_cell_gauss_point(p, at);
                pal_cell_shape(n_node, at, n, g);
                for (int m = 0; m < n_node; m++)
                    for (int c = 0; c < 3; c++) here[c] += n[m] * v[3 * node[m] + c];
                weight *= pal_subdivision_solid_jacobian(t->body.node_rest, node, n_node, g, J);
                weight *= (double)t->solid->samples[kind].density_kg_m3[64 * e + p];
                all += weight * (here[0] * here[0] + here[1] * here[1] + here[2] * here[2]);
            }
    return all;
}

/* with a density that differs from sample to sample */
static void kinetic_energy_is_that_of_the_moving_solid(void)
{
    for (int kind = 0; kind < KINDS; kind++) {
        solid_test t;
        REQUIRE(open_kind(&t, kind));
        for (pal_cell_kind k = 0; k < PAL_CELL_KINDS; k++)
            for (int i = 0; i < 64 * t.solid->elements.n[k]; i++)
                t.solid->samples[k].density_kg_m3[i] *= (float)(1 + 0.9 * solid_uniform(&t));
        pal_subdivision_mass_fill(t.solid, &t.mass);
        const int n3 = 3 * t.body.n_dof;
        double *out = malloc(sizeof *out * (size_t)n3), twice = 0;
        for (int i = 0; i < n3; i++) t.body.v[i] = solid_uniform(&t);
        pal_body_update_nodes(&t.body);
        pal_mass_operator_multiply(&t.mass, 1, 0, NULL, t.body.v, out);
        for (int i = 0; i < n3; i++) twice += t.body.v[i] * out[i];
        CHECK_NEAR(twice / square_of(&t, t.body.dv), 1, 1e-12);
        CHECK_NEAR(pal_body_kinetic_J(&t.body) / (0.5 * twice), 1, 1e-12);
        free(out);
        solid_close(&t);
    }
}

static void painted_density_changes_it_where_it_was_painted(void)
{
    solid_test t;
    solid_block(&t, 4, 0.1, 0);
    REQUIRE(solid_open(&t, 1));
    const size_t n_byte = sizeof(double) * (size_t)t.mass.n_entry;
    double *before = malloc(n_byte), kg = solid_mass_kg(t.solid), far = 0;
    memcpy(before, t.mass.mass_kg, n_byte);
    const pal_stroke stroke = {{-0.05, -0.05, -0.05}, 0.04, 0.5, 1, 5};
    t.def.stroke = &stroke, t.def.n_stroke = 1;
    pal_subdivision_solid_sample(t.solid, &t.def);
    pal_subdivision_mass_fill(t.solid, &t.mass);
    CHECK_LE(1.01 * kg, solid_mass_kg(t.solid));
    CHECK_NEAR(sum(t.mass.mass_kg, t.mass.n_entry) / solid_mass_kg(t.solid), 1, 1e-12);
    /* point 0 is the painted corner, the last the opposite one */
    const int last = t.mass.n_point - 1;
    CHECK_LE(1.5 * before[0], t.mass.mass_kg[0]);
    CHECK(entry(&t.mass, t.mass.mass_kg, last, last) == entry(&t.mass, before, last, last));
    t.def.n_stroke = 0;
    pal_subdivision_solid_sample(t.solid, &t.def);
    pal_subdivision_mass_fill(t.solid, &t.mass);
    for (int k = 0; k < t.mass.n_entry; k++) far = fmax(far, fabs(t.mass.mass_kg[k] - before[k]));
    CHECK(far == 0);
    free(before);
    solid_close(&t);
}

static void damping_is_one_number_or_a_matrix(void)
{
    solid_test t;
    REQUIRE(open_kind(&t, 2));
    CHECK_NEAR(t.mass.damping_1_s, PAL_DAMPING_1_S, 1e-6);
    CHECK(t.mass.damping_kg_s == NULL);
    double want = 0;
    for (pal_cell_kind k = 0; k < PAL_CELL_KINDS; k++)
        for (int i = 0; i < 64 * t.solid->elements.n[k]; i++) t.solid->samples[k].damping_1_s[i] = k == 1 ? 3 : 0.5;
    pal_subdivision_mass_fill(t.solid, &t.mass);
    CHECK(isnan(t.mass.damping_1_s));
    REQUIRE(t.mass.damping_kg_s != NULL);
    CHECK(t.mass.damping_max_1_s == 3);
    /* the hexahedra's mass alone, then all of it */
    double all = solid_mass_kg(t.solid);
    for (int i = 0; i < 64 * t.solid->elements.n[1]; i++) t.solid->samples[1].density_kg_m3[i] *= 2;
    double hex = solid_mass_kg(t.solid) - all;
    want = 3 * hex + 0.5 * (all - hex);
    CHECK_NEAR(sum(t.mass.damping_kg_s, t.mass.n_entry) / want, 1, 1e-12);
    CHECK(entry(&t.mass, t.mass.damping_kg_s, 3, 5) == entry(&t.mass, t.mass.damping_kg_s, 5, 3));
    solid_close(&t);
}

int main(void)
{
    RUN(the_sum_of_all_entries_is_the_integral_of_density);
    RUN(it_is_symmetric_to_the_bit_and_ascending);
    RUN(it_is_positive_definite);
    RUN(a_unit_translation_gives_the_lumped_masses);
    RUN(a_single_cube_has_the_textbook_matrix);
    RUN(kinetic_energy_is_that_of_the_moving_solid);
    RUN(painted_density_changes_it_where_it_was_painted);
    RUN(damping_is_one_number_or_a_matrix);
    return check_report();
}
