/* Hard cases (catalogue.txt) for model fem: numbers. Materials at their limits, contrasts, scales, damping, edits
 * of a running body, bodies of odd topology, elements of next to no volume. */
#include "tests/fixtures/body_sums.h"
#include "tests/fixtures/random.h"
#include "tests/stability/fem_case.h"
#include "tests/stability/hard_case.h"

static pal_diagnostic diag;

static bool open_kind(fem_beam *b, const hard_kind *kind, int nx, int ny, int nz)
{
    hard_make(b, kind, nx, ny, nz, true);
    return !beam_open(b, &diag);
}

/* loaded, let go: finite, energy less the load's work never above that of the begin by more than 1 % of what was put in
 */
static void hardly_compressible_bodies_step(void)
{
    static const double poisson[] = {0.49, 0.499, 0.4999, 0.49999, -0.5, -0.9999};
    for (int k = 0; k < HARD_KINDS; k++)
        for (int q = 0; q < 6; q++) {
            fem_beam b;
            hard_make(&b, &hard_kinds[k], 4, 2, 2, true);
            b.def->material.poisson = poisson[q];
            REQUIRE(!beam_open(&b, &diag));
            beam_load_end(&b, 60);
            double lowest = 0, max = 0, end[3];
            for (int i = 0; i < 120; i++) {
                REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                double now = pal_world_energy_J(b.world) - hard_work_J(b.body);
                lowest = fmin(lowest, now), max = fmax(max, now);
            }
            CHECK(pal_body_finite(b.body));
            HARD_CASE("poisson_step", "fem", "energy above the first, of what was put in", 100 * max / -lowest, 1, "%");
            beam_end(&b, end);
            CHECK(end[2] > 0 && end[2] < 0.5 * b.body->length_scale_m);
            CHECK_INT(hard_inverted(&b), 0);
            beam_free(&b);
        }
}

static void materials_that_are_none_are_refused(void)
{
    static const double poisson[] = {0.51, -1, NAN, INFINITY, 1e300}, young[] = {0, -1, NAN, INFINITY, 1e300};
    fem_beam b;
    hard_make(&b, &hard_kinds[0], 2, 1, 1, true);
    pal_world *none = NULL;
    for (int q = 0; q < 5; q++) {
        b.def->material.poisson = poisson[q];
        CHECK_INT(pal_world_create(b.scene, &diag, &none), PAL_ERR_REFUSED);
        CHECK(strstr(diag.text, "material.poisson"));
        b.def->material.poisson = 0.3;
        double keep = b.def->material.young_Pa;
        b.def->material.young_Pa = young[q];
        CHECK_INT(pal_world_create(b.scene, &diag, &none), PAL_ERR_REFUSED);
        CHECK(strstr(diag.text, "material.young_Pa"));
        b.def->material.young_Pa = keep;
    }
    /* an exact half is refused, a ratio just below is taken as 0.4999 and said so */
    b.def->material.poisson = 0.5;
    CHECK_INT(pal_material_check(&b.def->material, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "material.poisson: 0.5 is outside"));
    b.def->material.poisson = 0.49995;
    CHECK_INT(pal_material_check(&b.def->material, &diag), 0);
    CHECK(strstr(diag.text, "taken as 0.4999") && b.def->material.poisson == 0.4999);
    REQUIRE(!beam_open(&b, &diag));
    uint64_t hash = pal_world_hash(b.world);
    for (int q = 0; q < 5; q++) {
        pal_material bad = b.def->material;
        bad.poisson = poisson[q];
        CHECK_INT(pal_world_material(b.world, 0, &bad, &diag), PAL_ERR_REFUSED);
        bad = b.def->material, bad.young_Pa = young[q];
        CHECK_INT(pal_world_material(b.world, 0, &bad, &diag), PAL_ERR_REFUSED);
    }
    CHECK(hash == pal_world_hash(b.world));
    beam_free(&b);
}

/* one half a million times as hard as the other: at the support, as one layer on another, and at the free end, where it
 * turns as a whole. Every solve takes 30 iterations at most to 1e-6: nodes between the halves turn with the hard one
 * (rotations are weighted by stiffness; by volume it was 56). static_newton takes more than its 50 Newton iterations
 * where the hard half turns, since a linear step stretches it, which is not asked of it */
static void a_contrast_of_a_million_is_solved(void)
{
    static const char *const solvers[] = {"implicit_euler", "static_newton"};
    for (int k = 0; k < HARD_KINDS; k++)
        for (int s = 0; s < 3; s++) {
            bool hard_first = s < 2, rest = s == 1;
            fem_beam b;
            hard_make(&b, &hard_kinds[k], 6, 2, 2, true);
            beam_solver(&b, solvers[rest]);
            beam_key(&b, "tolerance", 1e-6);
            if (rest) {
                pal_entry_put_text(&b.def->solver, "linear", "pcg", NULL);
                beam_key(&b, "cg_tolerance", 1e-6);
            } else
                beam_key(&b, "iterations", 400);
            b.def->n_region = 1;
            b.def->region[0] = (pal_region){.kind = PAL_REGION_BOX,
                                            .young_Pa = 1e10,
                                            .poisson = NAN,
                                            .density_kg_m3 = NAN,
                                            .low_m = {hard_first ? -1 : 0.03, -1, -1},
                                            .high_m = {hard_first ? 0.03 : 1, 1, 1}};
            REQUIRE(!beam_open(&b, &diag));
            beam_load_end(&b, 10);
            int max = 0, n = rest ? 1 : 60;
            for (int i = 0; i < n; i++) {
                REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                pal_solve_report report;
                pal_world_solve_report(b.world, 0, &report);
                int each = report.n_newton > 0 ? (report.n_cg + report.n_newton - 1) / report.n_newton : 0;
                max = each > max ? each : max;
                CHECK(report.converged);
                CHECK_LE(report.residual, 1e-6);
            }
            HARD_CASE("contrast", "fem",
                      hard_first ? "hard half held: iterations to 1e-6"
                                 : "hard half at the free end: iterations to 1e-6",
                      max, 30, "");
            double hard = 0, soft = 0;
            for (int i = 0; i < b.body->n_node; i++) {
                double *to = (b.body->x_rest[3 * i] < 0.03 + 1e-9) == hard_first ? &hard : &soft;
                *to = fmax(*to, pal_dist3(b.body->x + 3 * i, b.body->x_rest + 3 * i));
            }
            if (hard_first) HARD_CASE("contrast", "fem", "hard half moves, over the soft one", hard / soft, 1e-4, "");
            CHECK(soft > 1e-4);
            printf("  %-11s %s, hard half %s: %d iterations, it moves %.2g of the soft one\n", hard_kinds[k].shown,
                   solvers[rest], hard_first ? "held" : "free", max, hard / soft);
            beam_free(&b);
        }
}

/* a box in its own units of length, stress and mass: where a node is after 20 steps */
static bool scaled(const hard_kind *kind, double h, double young, double x[3])
{
    fem_beam b;
    beam_make(&b, 3, 2, 2, h, true);
    beam_element(&b, kind->element, kind->law);
    beam_key(&b, "tolerance", 1e-8);
    b.def->material =
        (pal_material){.young_Pa = young, .poisson = 0.45, .density_kg_m3 = young * 5e-6 / (h * h), .damping_1_s = 4};
    b.def->support[0].high_m[0] = 1e-9 * h;
    for (int c = 0; c < 3; c++) b.def->support[0].low_m[c] = -1e9 * h, b.def->support[0].high_m[c] *= c ? h : 1;
    for (int i = 0; i < 3; i++) x[i] = NAN;
    bool ok = !beam_open(&b, &diag);
    uint64_t seed = 5;
    for (int i = 0; ok && i < 3 * b.body->n_dof; i++)
        if (!b.body->support[i / 3]) b.body->x[i] += 0.2 * h * (random_unit(&seed) - 0.3);
    if (ok) pal_world_invalidate_limits(b.world, 0);
    for (int i = 0; ok && i < 6; i++) {
        /* the same push in units of E h^2 */
        ok = !pal_world_load(b.world, 0, b.mesh.tets.n_node - 1, (double[3]){0, 0, 0.2 * young * h * h});
        ok = ok && !pal_world_step(b.world, 1.0 / 60);
    }
    int node = 3 * (b.mesh.tets.n_node - 1);
    for (int i = 0; ok && i < 3; i++) x[i] = (b.body->x[node + i] - b.body->x_rest[node + i]) / h;
    beam_free(&b);
    return ok;
}

static void any_scale_of_length_and_stiffness_gives_the_same_scaled_answer(void)
{
    static const double length[] = {1e-6, 1e-3, 1, 1e6}, young[] = {1e-3, 1, 1e6, 1e12};
    for (int k = 0; k < HARD_KINDS; k++) {
        double expect[3], x[3], worst = 0;
        REQUIRE(scaled(&hard_kinds[k], 0.01, 5000, expect));
        CHECK(fabs(expect[2]) > 1e-2);
        for (int l = 0; l < 4; l++)
            for (int e = 0; e < 4; e++) {
                CHECK(scaled(&hard_kinds[k], length[l], young[e], x));
                for (int c = 0; c < 3; c++) {
                    HARD_CASE("scales", "fem", "scaled answers differ by", fabs(x[c] - expect[c]), 1e-4, "h");
                    worst = fmax(worst, fabs(x[c] - expect[c]));
                }
            }
        printf("  %-11s differs by at most %.2g h of %.2g\n", hard_kinds[k].shown, worst, fabs(expect[2]));
    }
}

/* about 1e6 times critical: the slowest bending has some 10 rad/s */
static void huge_drag_creeps_and_no_drag_does_not_gain(void)
{
    for (int k = 0; k < HARD_KINDS; k++)
        for (int huge = 0; huge < 2; huge++) {
            fem_beam b;
            hard_make(&b, &hard_kinds[k], 4, 2, 2, true);
            b.def->material.damping_1_s = huge ? 2e7 : 0;
            REQUIRE(!beam_open(&b, &diag));
            for (int i = 0; i < b.body->n_dof; i++) b.body->x[3 * i + 2] += 5 * pow(b.body->x_rest[3 * i], 2);
            pal_world_invalidate_limits(b.world, 0);
            double first = pal_world_energy_J(b.world), before = first, away = hard_rms(b.body), rise = 0;
            for (int i = 0; i < 300; i++) {
                REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                double now = pal_world_energy_J(b.world);
                rise = fmax(rise, now - before);
                if (huge) CHECK_LE(hard_rms(b.body), away);
                before = now, away = hard_rms(b.body);
            }
            HARD_CASE(huge ? "drag" : "no_drag", "fem", "largest rise of energy in a step, over the first",
                      rise / first, 1e-6, "");
            if (huge)
                CHECK(before < first && before > 0.5 * first);
            else
                CHECK_LE(before, 0.5 * first);
            beam_free(&b);
        }
}

/* hardened and softened a thousandfold while bent under load: finite, energy bounded from each edit on, and in the end
 * where a body is that never was anything else */
static void material_edited_a_thousandfold_in_a_running_body(void)
{
    for (int k = 0; k < HARD_KINDS; k++) {
        fem_beam b;
        REQUIRE(open_kind(&b, &hard_kinds[k], 4, 2, 2));
        pal_material plain = b.def->material, to = plain;
        beam_load_end(&b, 60);
        hard_run run;
        hard_steps(&b, 5, 1.0 / 60, &run);
        double *rest = malloc(3 * sizeof *rest * (size_t)b.body->n_node), worst = 0;
        memcpy(rest, b.body->x, 3 * sizeof *rest * (size_t)b.body->n_node);
        for (int edit = 0; edit < 6; edit++) {
            to.young_Pa = plain.young_Pa * (edit % 3 == 0 ? 1000 : edit % 3 == 1 ? 1 : 1.0 / 1000);
            to.poisson = edit == 3 ? 0.4999 : plain.poisson;
            REQUIRE(!pal_world_material(b.world, 0, &to, &diag));
            double before = pal_world_energy_J(b.world) - hard_work_J(b.body), high = before, low = before;
            for (int i = 0; i < (edit % 3 == 2 ? 12 : 60); i++) {
                REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                REQUIRE(pal_body_finite(b.body));
                double now = pal_world_energy_J(b.world) - hard_work_J(b.body);
                high = fmax(high, now), low = fmin(low, now);
            }
            CHECK_LE(high - before, 0.01 * (before - low) + 1e-12);
        }
        REQUIRE(!pal_world_material(b.world, 0, &plain, &diag));
        for (int i = 0; i < 600; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        for (int i = 0; i < 3 * b.body->n_node; i++) worst = fmax(worst, fabs(b.body->x[i] - rest[i]));
        printf("  %-11s back within %.2g of S\n", hard_kinds[k].shown, worst / b.body->length_scale_m);
        CHECK_LE(worst, 1e-3 * b.body->length_scale_m);
        CHECK_INT(hard_inverted(&b), 0);
        free(rest);
        beam_free(&b);
    }
}

/* two pieces, only one held: it stands, the other falls by g dt^2 n (n + 1) / 2; static_newton says that it is loose */
static void each_of_several_pieces_is_simulated(void)
{
    for (int k = 0; k < HARD_KINDS; k++) {
        fem_beam b;
        hard_make(&b, &hard_kinds[k], 5, 2, 2, true);
        pal_tets *tets = &b.mesh.tets;
        int n = 0;
        for (int t = 0; t < tets->n_tet; t++) {
            double middle = 0;
            for (int c = 0; c < 4; c++) middle += 0.25 * tets->x[3 * tets->tet[4 * t + c]];
            if (middle > 0.02 && middle < 0.03) continue;
            memmove(tets->tet + 4 * n++, tets->tet + 4 * t, 4 * sizeof *tets->tet);
        }
        tets->n_tet = n;
        free(tets->face), free(tets->on_surface);
        tets->face = NULL, tets->on_surface = NULL;
        REQUIRE(!pal_tets_find_boundary(tets));
        pal_hexes_free(&b.mesh.hexes);
        REQUIRE(!pal_hexes_find(tets, &b.mesh.hexes, &diag));
        CHECK_INT(b.mesh.hexes.n_hex, 16);
        b.def->material.damping_1_s = 0;
        b.def->material.young_Pa = 1e5;
        pal_entry_init(&b.def->effect[b.def->n_effect++], "effects[0]", "gravity");
        REQUIRE(!beam_open(&b, &diag));
        /* then it is faster than 0.2 S a step, the most a body that something holds may move */
        const int n_step = 4;
        for (int i = 0; i < n_step; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        double fall = 9.81 / 3600 * n_step * (n_step + 1) / 2, max = 0, fixed = 0;
        for (int i = 0; i < b.body->n_node; i++) {
            double moved = b.body->x_rest[3 * i + 2] - b.body->x[3 * i + 2];
            if (b.body->x_rest[3 * i] > 0.025)
                max = fmax(max, fabs(moved - fall));
            else
                fixed = fmax(fixed, fabs(moved));
        }
        HARD_CASE("pieces", "fem", "fall of the loose piece beside its formula", 100 * max / fall, 1e-4, "%");
        CHECK_LE(fixed, 0.1 * b.body->length_scale_m);
        CHECK(fixed > 0);
        pal_world *none = NULL;
        beam_solver(&b, "static_newton");
        CHECK_INT(pal_world_create(b.scene, &diag, &none), PAL_ERR_REFUSED);
        if (k == 0) printf("  %s\n", diag.text);
        CHECK(strlen(diag.text) > 20);
        beam_free(&b);
    }
}

/* a tetrahedron of rest aspect 1e-4, and one of no volume at all: no step is limited by them, the body comes back. (A
 * whole layer of such slivers folds at the first push and stays folded: voxels have none) */
static void slivers_and_flat_tetrahedra_at_rest_do_no_harm(void)
{
    for (int k = 0; k < HARD_KINDS; k++)
        for (int flat = 0; flat < 2 && strncmp(hard_kinds[k].element, "hex", 3); flat++) {
            fem_beam b;
            hard_make(&b, &hard_kinds[k], 4, 2, 2, true);
            pal_tets *tets = &b.mesh.tets;
            const int n[3] = {4, 2, 2};
            /* an inner node onto the plane of the others of a tetrahedron that it is the right-angled corner of */
            int node = box_node(n, 2, 1, 1), t = 0;
            const int32_t *of = tets->tet;
            while (of[4 * t] != node && of[4 * t + 1] != node && of[4 * t + 2] != node && of[4 * t + 3] != node) t++;
            double middle[3] = {0, 0, 0}, *x = tets->x + 3 * node;
            for (int c = 4 * t; c < 4 * t + 4; c++)
                if (of[c] != node) pal_axpy3(middle, 1.0 / 3, tets->x + 3 * of[c]);
            for (int c = 0; c < 3; c++) x[c] = flat ? middle[c] : middle[c] + 1e-4 * (x[c] - middle[c]);
            REQUIRE(!beam_open(&b, &diag));
            CHECK_INT(pal_world_substeps(b.world), 1);
            beam_load_end(&b, 60);
            for (int i = 0; i < 60; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
            CHECK(pal_body_finite(b.body));
            double pressed = hard_rms(b.body);
            CHECK(pressed > 1e-4 * b.body->length_scale_m && pressed < 0.5 * b.body->length_scale_m);
            double none[3] = {0, 0, 0}, first = pal_world_energy_J(b.world), max = 0;
            for (int i = 0; i < tets->n_node; i++) pal_world_load(b.world, 0, i, none);
            for (int i = 0; i < 600; i++) {
                REQUIRE(!pal_world_step(b.world, 1.0 / 60));
                max = fmax(max, pal_world_energy_J(b.world));
            }
            printf("  %-11s %s: pressed %.2g, back within %.2g of S\n", hard_kinds[k].shown, flat ? "flat" : "sliver",
                   pressed / b.body->length_scale_m, hard_rms(b.body) / b.body->length_scale_m);
            CHECK_LE(max, 1.01 * first);
            HARD_CASE("slivers", "fem", "every element: off rest 10 s after",
                      100 * hard_rms(b.body) / b.body->length_scale_m, 0.1, "% S");
            beam_free(&b);
        }
}

static void held_and_single_elements_step(void)
{
    for (int k = 0; k < HARD_KINDS; k++)
        for (int fixed = 0; fixed < 2; fixed++) {
            fem_beam b;
            hard_make(&b, &hard_kinds[k], 1, 1, 1, false);
            b.def->n_support = fixed;
            b.def->support[0].high_m[0] = 1;
            pal_entry_init(&b.def->effect[b.def->n_effect++], "effects[0]", "gravity");
            REQUIRE(!beam_open(&b, &diag));
            for (int i = 0; i < 20; i++) CHECK_INT(pal_world_step(b.world, 1.0 / 60), 0);
            CHECK(pal_body_finite(b.body));
            /* v <- (v - g dt) / (1 + c dt) */
            double v = 0, z = 0;
            for (int i = 0; i < 20; i++) v = (v - 9.81 / 60) / (1 + 4.0 / 60), z += v / 60;
            for (int i = 0; i < b.body->n_node; i++)
                HARD_CASE(fixed ? "all_held" : "one_element", "fem", fixed ? "moves by" : "off its free fall",
                          fabs(b.body->x[3 * i + 2] - b.body->x_rest[3 * i + 2] - (fixed ? 0 : z)) / fabs(z), 1e-6,
                          "of a fall");
            beam_free(&b);
        }
}

/* 1e4 steps of a free body that swings and turns: momentum within 1e-4, no force and no torque of its own */
static void a_free_body_keeps_its_momentum_for_ten_thousand_steps(void)
{
    for (int k = HARD_HEX; k <= HARD_NEO_HEX; k += HARD_NEO_HEX - HARD_HEX) {
        fem_beam b;
        hard_make(&b, &hard_kinds[k], 2, 1, 1, false);
        b.def->material.damping_1_s = 0;
        REQUIRE(!beam_open(&b, &diag));
        uint64_t seed = 3;
        for (int i = 0; i < b.body->n_node; i++)
            pal_set3(b.body->v + 3 * i, 0.01 + 0.05 * random_unit(&seed), 0.5 * (b.body->x_rest[3 * i] - 0.01),
                     0.05 * random_unit(&seed));
        double before[3], now[3], energy = pal_world_energy_J(b.world);
        body_momentum(b.body, before);
        for (int i = 0; i < 10000 / HARD_SLOW; i++) {
            REQUIRE(!pal_world_step(b.world, 1.0 / 60));
            if (i % 100 == 0) CHECK_LE(pal_world_energy_J(b.world), energy * (1 + 1e-6));
        }
        body_momentum(b.body, now);
        HARD_CASE("momentum", "fem", "drift of momentum", pal_dist3(now, before) / pal_norm3(before), 1e-4,
                  "in 10,000 steps");
        beam_free(&b);
    }
}

int main(void)
{
    RUN(hardly_compressible_bodies_step);
    RUN(materials_that_are_none_are_refused);
    RUN(a_contrast_of_a_million_is_solved);
    RUN(any_scale_of_length_and_stiffness_gives_the_same_scaled_answer);
    RUN(huge_drag_creeps_and_no_drag_does_not_gain);
    RUN(material_edited_a_thousandfold_in_a_running_body);
    RUN(each_of_several_pieces_is_simulated);
    RUN(slivers_and_flat_tetrahedra_at_rest_do_no_harm);
    RUN(held_and_single_elements_step);
    RUN(a_free_body_keeps_its_momentum_for_ten_thousand_steps);
    return check_report();
}
