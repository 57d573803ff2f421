/* Component hex_elastic: bodies whose voxels are inverted. */
#include "tests/fixtures/hex_bodies.h"

#include "server/base/vec3.h"

static void begin(hex_body *b, int nx, int ny, int nz, const char *law)
{
    const int n[3] = {nx, ny, nz};
    hex_body_begin(b, n, NULL, 0.01);
    pal_entry_put_text(&b->item, "law", law, NULL);
}

/* (K + shift) dx = f again and again, moves cut to half an edge: runs downhill with some inertia of its own */
static void relax(hex_body *b, int n_step)
{
    int n = 3 * b->body.n_node;
    double *dx = hex_zeros(n);
    uint8_t *all = malloc((size_t)b->body.n_node);
    memset(all, 1, (size_t)b->body.n_node);
    for (int t = 0; t < n_step; t++) {
        b->step.time_s += b->step.dt_s;
        (void)hex_effect->recovery.recover(b->row, &b->step);
        hex_effect->tangent->linearise(b->row, &b->body);
        const double *f = hex_force(b);
        memset(dx, 0, sizeof *dx * (size_t)n);
        hex_solve(b, all, 0.5, f, dx);
        double max = hex_largest(dx, n), cut = max > 0.005 ? 0.005 / max : 1;
        for (int i = 0; i < n; i++) b->body.x[i] += cut * dx[i];
    }
    free(dx), free(all);
}

/* inverted (mirrored, shuffled, flat, in a point): found, in regions, back on cubes at rest in the end */
static void inverted_bodies_recover(void)
{
    for (int kind = 0; kind < 8; kind++) {
        hex_body b;
        begin(&b, 4, 2, 2, "corotational");
        b.def->material.poisson = 0.3;
        REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
        int n = b.body.n_node;
        double *x = b.body.x;
        for (int i = 0; i < 3 * n; i++) x[i] *= 1.02;
        double small = hex_energy(&b);
        uint64_t seed = 100 + (uint64_t)kind;
        for (int i = 0; i < n; i++) {
            pal_copy3(x + 3 * i, b.body.x_rest + 3 * i);
            if (kind == 0) x[3 * i] = -x[3 * i];
            if (kind == 1) x[3 * i + 2] = 1e-9 * hex_random(&seed);
            if (kind == 2)
                for (int k = 0; k < 3; k++) x[3 * i + k] = 1e-9 * hex_random(&seed);
        }
        for (int i = n - 1; i > 0 && kind > 2; i--) {
            int j = (int)((hex_random(&seed) + 1) / 2 * (i + 1)) % (i + 1);
            double keep[3];
            pal_copy3(keep, x + 3 * i);
            pal_copy3(x + 3 * i, x + 3 * j);
            pal_copy3(x + 3 * j, keep);
        }
        /* of a world that follows another: they go on */
        b.body.safeguards.n_inversion = 1000, b.body.safeguards.n_change = 500;
        CHECK(hex_effect->recovery.recover(b.row, &b.step) & PAL_INVERTED);
        CHECK(pal_recovery_acts(b.row->recovery));
        relax(&b, 300);
        CHECK(b.body.safeguards.n_inversion > 1000 && b.body.safeguards.n_inversion <= 1301);
        CHECK(b.body.safeguards.n_change >= 502 && b.body.safeguards.n_change <= 510);
        CHECK(!pal_recovery_acts(b.row->recovery));
        CHECK_LE(0.9, pal_hex_min_corner(b.row, &b.body));
        CHECK_LE(hex_energy(&b), 1e-3 * small);
        hex_effect->reset(b.row, &b.body);
        CHECK(b.row->recovery->tank_J == 0 && !b.row->recovery->was_bad);
        hex_body_free(&b);
    }
}

static const char *const laws[3] = {"corotational", "linear", "neo_hookean"};

static void an_inverted_body_without_recovery_runs_on(void)
{
    for (int law = 0; law < 3; law++) {
        hex_body b;
        begin(&b, 3, 2, 2, laws[law]);
        pal_entry_put_bool(&b.item, "recover", false, NULL);
        REQUIRE(hex_body_make(&b) == PAL_ERR_OK);
        CHECK(b.row->recovery == NULL);
        for (int i = 0; i < b.body.n_node; i++) b.body.x[3 * i] *= -1;
        relax(&b, 50);
        CHECK(pal_body_finite(&b.body));
        CHECK(isfinite(hex_energy(&b)));
        hex_body_free(&b);
    }
}

int main(void)
{
    RUN(inverted_bodies_recover);
    RUN(an_inverted_body_without_recovery_runs_on);
    return check_report();
}
