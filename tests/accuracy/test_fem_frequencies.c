/* Natural frequencies of the reference beam: stiffness assembled by the row's tangent and lumped masses, against
 * ../shared/reference (CalculiX) and against theory: Timoshenko's beam for bending (free at its end, solved along the
 * beam), Saint-Venant's torsion, stretching of a bar. */
#include "server/base/vec3.h"
#include "server/num/cholesky.h"
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/fixtures/fem_beam.h"
#include "tests/fixtures/random.h"

static const double young_Pa = 1e5;

static const pal_component *elastic_row(const fem_beam *b)
{
    for (int r = 0; r < pal_world_component_count(b->world); r++) {
        const pal_component *row = pal_world_component(b->world, r);
        if (row->effect->stage == PAL_STAGE_FORCE && row->effect->internal) return row;
    }
    abort();
}

enum { MODES = 12 };

/* eigenvalues of the symmetric a [n][n] by Jacobi turns: a becomes diagonal, v (columns) the vectors */
static void jacobi(int n, double a[MODES][MODES], double v[MODES][MODES])
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) v[i][j] = i == j;
    for (int sweep = 0; sweep < 30; sweep++)
        for (int p = 0; p < n; p++)
            for (int q = p + 1; q < n; q++) {
                if (a[p][q] == 0) continue;
                double angle = 0.5 * atan2(2 * a[p][q], a[q][q] - a[p][p]), c = cos(angle), s = sin(angle);
                for (int k = 0; k < n; k++) {
                    double x = a[k][p], y = a[k][q];
                    a[k][p] = c * x - s * y, a[k][q] = s * x + c * y;
                }
                for (int k = 0; k < n; k++) {
                    double x = a[p][k], y = a[q][k];
                    a[p][k] = c * x - s * y, a[q][k] = s * x + c * y;
                    x = v[k][p], y = v[k][q];
                    v[k][p] = c * x - s * y, v[k][q] = s * x + c * y;
                }
            }
}

static double times_mass(const pal_body *b, const double *x, const double *y)
{
    double sum = 0;
    for (int i = 0; i < b->n_node; i++)
        if (!b->support[i]) sum += b->mass_kg[i] * pal_dot3(x + 3 * i, y + 3 * i);
    return sum;
}

/* one step of subspace iteration: vectors become K^-1 M times themselves, orthonormal in M and ordered; eigenvalue */
static void iterate_modes(const pal_body *b, pal_cholesky *factor, double *mode[MODES], double eigenvalue[MODES])
{
    size_t n3 = 3 * (size_t)b->n_node;
    double *old[MODES], k_part[MODES][MODES], turn[MODES][MODES];
    for (int m = 0; m < MODES; m++) {
        old[m] = calloc(n3, sizeof(double));
        if (!old[m]) abort();
        for (size_t i = 0; i < n3; i++) old[m][i] = b->support[i / 3] ? 0 : b->mass_kg[i / 3] * mode[m][i];
        CHECK_INT(pal_cholesky_solve(factor, old[m], mode[m]), 0);
        /* Gram and Schmidt, of the right sides K x too */
        for (int pass = 0; pass < 2; pass++)
            for (int j = 0; j < m; j++) {
                double share = times_mass(b, mode[m], mode[j]);
                for (size_t i = 0; i < n3; i++) mode[m][i] -= share * mode[j][i], old[m][i] -= share * old[j][i];
            }
        double size = 1 / sqrt(times_mass(b, mode[m], mode[m]));
        for (size_t i = 0; i < n3; i++) mode[m][i] *= size, old[m][i] *= size;
    }
    for (int i = 0; i < MODES; i++)
        for (int j = 0; j < MODES; j++) {
            k_part[i][j] = 0;
            for (size_t k = 0; k < n3; k++) k_part[i][j] += 0.5 * (mode[i][k] * old[j][k] + mode[j][k] * old[i][k]);
        }
    jacobi(MODES, k_part, turn);
    int order[MODES];
    for (int m = 0; m < MODES; m++) {
        int at = m;
        for (; at > 0 && k_part[order[at - 1]][order[at - 1]] > k_part[m][m]; at--) order[at] = order[at - 1];
        order[at] = m;
    }
    for (int m = 0; m < MODES; m++) memcpy(old[m], mode[m], n3 * sizeof(double));
    for (int m = 0; m < MODES; m++) {
        eigenvalue[m] = k_part[order[m]][order[m]];
        memset(mode[m], 0, n3 * sizeof(double));
        for (int j = 0; j < MODES; j++)
            for (size_t k = 0; k < n3; k++) mode[m][k] += turn[j][order[m]] * old[j][k];
    }
    for (int m = 0; m < MODES; m++) free(old[m]);
}

/* lowest frequencies of the held beam, Hz, by subspace iteration on K (assembled by the row's tangent) and lumped M */
static bool find_frequencies(const fem_beam *b, int n, double hz[])
{
    const pal_component *row = elastic_row(b);
    const pal_body *body = b->body;
    pal_arena *arena = pal_arena_create(1 << 20, true);
    pal_cholesky *factor = NULL;
    pal_cliques clique;
    pal_block_matrix k;
    double *mode[MODES], eigenvalue[MODES] = {0}, before = 0;
    uint64_t seed = 5;
    bool good = arena && row->effect->tangent->couple(row->self, &clique) &&
                !pal_block_matrix_make(body->n_node, &clique, 1, arena, &k);
    if (!good) return false;
    row->effect->tangent->linearise(row->self, body);
    pal_block_matrix_zero(&k);
    row->effect->tangent->assemble(row->self, 1, &k);
    good = !pal_cholesky_create(&k, body->support, &factor) && !pal_cholesky_factor(factor, &k, false);
    for (int m = 0; m < MODES; m++) {
        mode[m] = calloc(3 * (size_t)body->n_node, sizeof(double));
        if (!mode[m]) abort();
        for (int i = 0; i < 3 * body->n_node; i++) {
            double value = (double)(int64_t)random_bits(&seed);
            mode[m][i] = body->support[i / 3] ? 0 : value;
        }
    }
    for (int it = 0; it < 60 && good; it++) {
        iterate_modes(body, factor, mode, eigenvalue);
        if (fabs(eigenvalue[n - 1] - before) < 1e-9 * eigenvalue[n - 1]) break;
        before = eigenvalue[n - 1];
    }
    for (int m = 0; m < n; m++) hz[m] = sqrt(eigenvalue[m]) / (2 * M_PI);
    for (int m = 0; m < MODES; m++) free(mode[m]);
    pal_cholesky_destroy(factor);
    pal_arena_destroy(arena);
    return good;
}

/* what a Timoshenko cantilever lacks at frequency f to be free at its end: the determinant of moment and shear force
 * there for the two motions that leave the clamp, integrated along the beam (Runge and Kutta); zero at its frequencies
 */
static double free_end(double length, double side, double nu, double density, double f)
{
    double area = side * side, inertia = area * area / 12, mu = young_Pa / (2 * (1 + nu)), w2 = 4 * M_PI * M_PI * f * f;
    double bend_c = young_Pa * inertia, shear_c = 10 * (1 + nu) / (12 + 11 * nu) * mu * area, end[2][2];
    for (int start = 0; start < 2; start++) {
        enum { STEPS = 400 };
        /* deflection, turn, moment, shear force */
        double y[4] = {0, 0, start == 0, start == 1}, dx = length / STEPS;
        for (int s = 0; s < STEPS; s++) {
            double sum[4] = {0}, slope[4] = {0};
            static const double ahead[4] = {0, 0.5, 0.5, 1}, weight[4] = {1, 2, 2, 1};
            for (int stage = 0; stage < 4; stage++) {
                double z[4];
                for (int k = 0; k < 4; k++) z[k] = y[k] + ahead[stage] * dx * slope[k];
                slope[0] = z[1] + z[3] / shear_c;
                slope[1] = z[2] / bend_c;
                slope[2] = -z[3] - density * inertia * w2 * z[1];
                slope[3] = -density * area * w2 * z[0];
                for (int k = 0; k < 4; k++) sum[k] += weight[stage] * slope[k] / 6;
            }
            for (int k = 0; k < 4; k++) y[k] += dx * sum[k];
        }
        end[start][0] = y[2], end[start][1] = y[3];
    }
    return end[0][0] * end[1][1] - end[0][1] * end[1][0];
}

/* the first two bending frequencies, then torsion and stretching, first of each */
static void beam_theory(double length, double side, double nu, double density, double hz[4])
{
    int found = 0;
    double step = 0.05, before = free_end(length, side, nu, density, step);
    for (double f = 2 * step; found < 2 && f < 1000; f += step) {
        double now = free_end(length, side, nu, density, f), low = f - step, high = f;
        if ((now > 0) != (before > 0)) {
            for (int k = 0; k < 50; k++) {
                double middle = 0.5 * (low + high);
                *((free_end(length, side, nu, density, middle) > 0) == (before > 0) ? &low : &high) = middle;
            }
            hz[found++] = low;
        }
        before = now;
    }
    /* Saint-Venant's torsion constant of a square is 0.14058 of its side to the fourth, the polar moment a sixth */
    hz[2] = sqrt(6 * 0.140577 * young_Pa / (2 * (1 + nu)) / density) / (4 * length);
    hz[3] = sqrt(young_Pa / density) / (4 * length);
}

/* "hz" of a Poisson ratio from the reference beam's problem.json */
static bool read_frequencies(const char *nu, double hz[8])
{
    const char *path = check_shared("reference/beam/problem.json");
    FILE *in = path ? fopen(path, "rb") : NULL;
    static char text[1 << 16];
    if (!in) return false;
    text[fread(text, 1, sizeof text - 1, in)] = 0;
    fclose(in);
    char *at = strstr(text, "undamped_natural_frequencies"), *end;
    char key[32];
    snprintf(key, sizeof key, "\"nu\": %s,", nu);
    at = at ? strstr(at, key) : NULL;
    at = at ? strstr(at, "\"hz\": [") : NULL;
    if (at) at += 7;
    for (int k = 0; k < 8 && at; k++, at = *end == ',' ? end + 1 : end) {
        hz[k] = strtod(at, &end);
        if (end == at) return false;
    }
    return at != NULL;
}

static bool beam_frequencies(int n, const char *element, double nu, double hz[8])
{
    fem_beam b;
    pal_diagnostic diag = {""};
    beam_reference(&b, n);
    b.def->material.poisson = nu;
    beam_element(&b, element, "linear");
    bool good = !beam_open(&b, &diag) && find_frequencies(&b, 8, hz);
    beam_free(&b);
    return good;
}

static void the_beam_sounds_as_reference_and_theory_say(void)
{
    static const struct {
        const char *nu;
        double value;
    } nus[] = {{"0.3", 0.3}, {"0.45", 0.45}};
    for (int m = 0; m < 2; m++) {
        double hz[3][8], want[8], theory[4];
        for (int k = 0; k < 3; k++) REQUIRE(beam_frequencies(2 << k, "hex8_bbar", nus[m].value, hz[k]));
        /* theory does not know that the clamped face keeps its shape, which raises all of them */
        beam_theory(0.2, 0.05, nus[m].value, 1000, theory);
        printf("  nu %-4s beam theory: bending %.3f %.3f, torsion %.3f, stretching %.3f Hz\n", nus[m].nu, theory[0],
               theory[1], theory[2], theory[3]);
        CHECK_NEAR(hz[2][0] / theory[0], 1, 0.035);
        CHECK_NEAR(hz[2][3] / theory[1], 1, 0.03);
        CHECK_NEAR(hz[2][2] / theory[2], 1, 0.01);
        CHECK_NEAR(hz[2][5] / theory[3], 1, 0.02);
        /* the two bending directions are one */
        CHECK_NEAR(hz[2][0] / hz[2][1], 1, 1e-6);
        CHECK_NEAR(hz[2][3] / hz[2][4], 1, 1e-6);
        if (!read_frequencies(nus[m].nu, want)) continue;
        for (int f = 0; f < 8; f++) {
            double off[3];
            for (int k = 0; k < 3; k++) off[k] = hz[k][f] / want[f] - 1;
            printf("  nu %-4s mode %d: %8.4f Hz; hex8_bbar 2, 4, 8 voxels across: %+.2f, %+.2f, %+.3f %%, order %.2f\n",
                   nus[m].nu, f + 1, want[f], 100 * off[0], 100 * off[1], 100 * off[2],
                   log(fabs(off[1] / off[2])) / log(2));
            /* twisting: lumped masses stand too far out, by h^2; the others: the corners of the clamped face, where
             * stress grows without bound, slow refinement down */
            bool twist = f == 2 || f == 6;
            CHECK_NEAR(off[2], 0, twist ? 0.01 : 0.0035);
            CHECK_NEAR(off[1], 0, twist ? 0.04 : 0.009);
            if (twist) CHECK_NEAR(log(off[1] / off[2]) / log(2), 2, 0.1);
        }
        double ten[8], four[8];
        REQUIRE(beam_frequencies(2, "tet10", nus[m].value, ten));
        REQUIRE(beam_frequencies(4, "tet4", nus[m].value, four));
        printf("  nu %-4s first: tet10 2 voxels across %+.2f %%, tet4 4 across %+.2f %%\n", nus[m].nu,
               100 * (ten[0] / want[0] - 1), 100 * (four[0] / want[0] - 1));
        CHECK_NEAR(ten[0] / want[0], 1, 0.03);
        CHECK_NEAR(four[0] / want[0], 1, 0.1);
    }
}

int main(void)
{
    RUN(the_beam_sounds_as_reference_and_theory_say);
    return check_report();
}
