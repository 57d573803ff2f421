/* Springs of adaptive surfaces: forces, energies, bounds, laws and constants on every mixture of levels. */
#include "tests/fixtures/adaptive_plan.h"
#include "tests/fixtures/boxes.h"

/* shape 0: a sphere, 1: the stomach, 2: a sheet; a mixture of three levels, no anchors */
static bool open_mixture(shell_plan *p, int shape, const char *law, double c_Ns_m)
{
    if (shape == 0) shell_plan_sphere(p);
    if (shape == 1) shell_plan_stomach(p);
    if (shape == 2) shell_plan_sheet(p, 6, 5, 0.1, 0.08);
    shell_scene_number(&p->s, "levels", 3);
    shell_scene_number(&p->s, "k_shape_N_m", 0);
    shell_scene_number(&p->s, "c_spring_Ns_m", c_Ns_m);
    shell_scene_text(&p->s, "law", law);
    if (!shell_plan_open(p)) return false;
    shell_plan_mix(p, 40);
    return true;
}

static double largest(const shell_plan *p)
{
    double max = 0;
    for (int i = 0; i < 3 * p->body->n_node; i++) max = fmax(max, fabs(p->body->f[i]));
    return max;
}

static const char *const laws[2] = {"membrane", "paper"};

static void force_is_minus_the_gradient_of_energy(void)
{
    for (int shape = 0; shape < 3; shape++)
        for (int law = 0; law < 2; law++) {
            shell_plan p;
            REQUIRE(open_mixture(&p, shape, laws[law], 0));
            const pal_component *row = shell_plan_row(&p, "edge_spring");
            shell_plan_shake(&p, 0.1, 0);
            p.adaptive->spring_ramp = 0.7;
            shell_plan_force(&p, row);
            double max = largest(&p), worst = 0, step = 1e-6 * p.body->edge_m;
            CHECK(max > 0.01);
            for (int k = 0; k < p.body->n_active; k += 3)
                for (int c = 0; c < 3; c++) {
                    int i = 3 * pal_body_point(p.body, k) + c;
                    double x = p.body->x[i];
                    p.body->x[i] = x + step;
                    double up = row->effect->energy(row->self, p.body);
                    p.body->x[i] = x - step;
                    double down = row->effect->energy(row->self, p.body);
                    p.body->x[i] = x;
                    worst = fmax(worst, fabs(p.body->f[i] + (up - down) / (2 * step)) / max);
                }
            CHECK_LE(worst, 1e-6);
            shell_plan_close(&p);
        }
}

static void no_net_force_or_torque_whatever_the_motion(void)
{
    for (int shape = 0; shape < 3; shape++) {
        shell_plan p;
        REQUIRE(open_mixture(&p, shape, "membrane", 0.05));
        double force[3] = {0}, torque[3] = {0}, sum = 0;
        shell_plan_shake(&p, 0.3, 2);
        shell_plan_force(&p, shell_plan_row(&p, "edge_spring"));
        for (int i = 0; i < p.body->n_node; i++) {
            const double *f = p.body->f + 3 * i;
            double t[3];
            pal_cross3(t, p.body->x + 3 * i, f);
            pal_add3(force, force, f);
            pal_add3(torque, torque, t);
            sum += pal_norm3(f);
        }
        CHECK(sum > 0.1);
        CHECK_LE(pal_norm3(force), 1e-13 * sum);
        CHECK_LE(pal_norm3(torque), 1e-13 * sum * p.body->length_scale_m);
        shell_plan_close(&p);
    }
}

static void rest_force_is_zero_on_every_mixture(void)
{
    for (int shape = 0; shape < 3; shape++)
        for (int law = 0; law < 2; law++) {
            shell_plan p;
            REQUIRE(open_mixture(&p, shape, laws[law], 0.05));
            const pal_component *row = shell_plan_row(&p, "edge_spring");
            double k_0 = sqrt(3) / 2 * 5000 * 0.003;
            for (int round = 0; round < 5; round++) {
                /* nodes that a split put on the straight middle of a bent surface go to their rest places */
                shell_plan_shake(&p, 0, 0);
                shell_plan_force(&p, row);
                CHECK_LE(largest(&p), 1e-13 * k_0 * p.body->edge_m);
                CHECK_LE(row->effect->energy(row->self, p.body), 1e-28 * k_0);
                shell_plan_mix(&p, 10);
            }
            shell_plan_close(&p);
        }
}

/* forces of damping alone: with damping minus without, at the same state */
static void damping_takes_energy_and_leaves_momentum(void)
{
    shell_plan p, q;
    REQUIRE(open_mixture(&p, 1, "membrane", 0.05) && open_mixture(&q, 1, "membrane", 0));
    shell_plan_shake(&p, 0.2, 1);
    shell_plan_shake(&q, 0.2, 1);
    CHECK(!memcmp(p.body->x, q.body->x, 3 * sizeof(double) * (size_t)p.body->n_node));
    shell_plan_force(&p, shell_plan_row(&p, "edge_spring"));
    shell_plan_force(&q, shell_plan_row(&q, "edge_spring"));
    double power = 0, net[3] = {0}, sum = 0;
    for (int i = 0; i < p.body->n_node; i++) {
        double f[3];
        pal_sub3(f, p.body->f + 3 * i, q.body->f + 3 * i);
        power += pal_dot3(f, p.body->v + 3 * i);
        pal_add3(net, net, f);
        sum += pal_norm3(f);
    }
    CHECK(sum > 0.1);
    CHECK_LE(power, -0.01 * sum);
    CHECK_LE(pal_norm3(net), 1e-12 * sum);
    /* -sum c share ((dv.d)/l)^2, spring by spring */
    double want = 0;
    for (int s = 0; s < p.adaptive->n_spring; s++) {
        const int32_t *end = p.adaptive->levels.edge[p.adaptive->spring[s]].vertex;
        double d[3], dv[3];
        pal_sub3(d, p.body->x + 3 * end[1], p.body->x + 3 * end[0]);
        pal_sub3(dv, p.body->v + 3 * end[1], p.body->v + 3 * end[0]);
        double rate = pal_dot3(dv, d) / pal_norm3(d);
        want -= 0.05 * (double)p.adaptive->spring_share[s] * rate * rate;
    }
    CHECK_NEAR(power / want, 1, 1e-10);
    /* a rigid motion is not damped */
    shell_plan_shake(&p, 0, 0);
    const double spin[3] = {1, -2, 3};
    for (int k = 0; k < p.body->n_active; k++) {
        int i = pal_body_point(p.body, k);
        pal_cross3(p.body->v + 3 * i, spin, p.body->x + 3 * i);
    }
    shell_plan_force(&p, shell_plan_row(&p, "edge_spring"));
    CHECK_LE(largest(&p), 1e-14);
    shell_plan_close(&p);
    shell_plan_close(&q);
}

/* all on one point: every spring pushes with k l0 along its rest direction and damps nothing */
static void springs_without_length_push_open(void)
{
    shell_plan p;
    REQUIRE(open_mixture(&p, 0, "membrane", 0.05));
    double k_0 = sqrt(3) / 2 * 5000 * 0.003, *want = calloc(3 * (size_t)p.body->n_node, sizeof *want), worst = 0;
    shell_plan_shake(&p, 0, 1);
    for (int k = 0; k < p.body->n_active; k++) pal_set3(p.body->x + 3 * pal_body_point(p.body, k), 0.01, 0.02, 0.03);
    for (int s = 0; s < p.adaptive->n_spring; s++) {
        const int32_t *end = p.adaptive->levels.edge[p.adaptive->spring[s]].vertex;
        double d[3];
        pal_sub3(d, p.body->x_rest + 3 * end[1], p.body->x_rest + 3 * end[0]);
        pal_axpy3(want + 3 * end[1], k_0 * (double)p.adaptive->spring_share[s], d);
        pal_axpy3(want + 3 * end[0], -k_0 * (double)p.adaptive->spring_share[s], d);
    }
    shell_plan_force(&p, shell_plan_row(&p, "edge_spring"));
    for (int i = 0; i < 3 * p.body->n_node; i++) worst = fmax(worst, fabs(p.body->f[i] - want[i]));
    CHECK_LE(worst, 1e-12);
    CHECK(largest(&p) > 0.01);
    free(want);
    /* let go, springs get their lengths again; the surface may stay creased, as nothing here bends */
    double dt = 0.5 * shell_plan_limit(&p), sum = 0;
    shell_plan_run(&p, 1500, dt);
    CHECK(pal_body_finite(p.body));
    for (int s = 0; s < p.adaptive->n_spring; s++) {
        const int32_t *end = p.adaptive->levels.edge[p.adaptive->spring[s]].vertex;
        sum += pal_dist3(p.body->x + 3 * end[1], p.body->x + 3 * end[0]) /
               pal_dist3(p.body->x_rest + 3 * end[1], p.body->x_rest + 3 * end[0]);
    }
    CHECK_NEAR(sum / p.adaptive->n_spring, 1, 0.1);
    shell_plan_close(&p);
}

/* sum over the body's area of what is shown */
static double field_sum(const shell_plan *p, pal_field field, double *area_m2)
{
    shell_plan *plan = (shell_plan *)(uintptr_t)p;
    const pal_component *row = shell_plan_row(plan, "edge_spring");
    double *sum = calloc(2 * (size_t)p->body->n_node, sizeof *sum), total = 0;
    *area_m2 = 0;
    if (!sum) abort();
    row->effect->inspect.measure(row->self, p->body, field, sum, sum + p->body->n_node);
    for (int i = 0; i < p->body->n_node; i++) total += sum[i], *area_m2 += sum[p->body->n_node + i];
    free(sum);
    return total;
}

static double field_mean(const shell_plan *p, pal_field field)
{
    double area_m2, sum = field_sum(p, field, &area_m2);
    return sum / area_m2;
}

/* whatever the mixture and the law: shares of the leaves in their springs add up */
static void energy_of_the_leaves_is_that_of_the_springs(void)
{
    for (int shape = 0; shape < 3; shape++)
        for (int law = 0; law < 2; law++) {
            shell_plan p;
            REQUIRE(open_mixture(&p, shape, laws[law], 0));
            shell_plan_shake(&p, 0.1, 0);
            p.adaptive->spring_ramp = 0.7;
            const pal_component *row = shell_plan_row(&p, "edge_spring");
            double area_m2, density = field_sum(&p, PAL_FIELD_ENERGY_J_M3, &area_m2);
            CHECK_NEAR(0.003 * density / row->effect->energy(row->self, p.body), 1, 1e-6);
            shell_plan_close(&p);
        }
}

/* a flat lattice of equilateral triangles, thickness t: springs have the energy of a sheet with Young's modulus E t per
 * length and Poisson ratio 1/3 in every direction. The strain of 1e-5 shows in the digits; on finer levels the
 * butterfly rounds those corners of the rim that turn by 60 degrees, which is 0.6 % of the energy */
static void sheet_of_equilateral_triangles_stretches_as_its_material(void)
{
    for (int level = 0; level < 4; level++) {
        shell_plan p;
        shell_plan_sheet(&p, 9, 9, 0.08, 0.08 * sqrt(0.75));
        pal_surface *surface = &p.s.mesh.surface;
        /* each row half an edge to the side; which way depends on how cells are cut */
        for (int way = -1; way <= 1; way += 2) {
            for (int i = 0; i < surface->n_vertex; i++)
                surface->x[3 * i] += (way < 0 ? -1 : 2) / sqrt(3) * surface->x[3 * i + 1];
            double longest = 0;
            for (int i = 0; i < 3; i++)
                longest = fmax(longest,
                               pal_dist3(surface->x + 3 * surface->tri[i], surface->x + 3 * surface->tri[(i + 1) % 3]));
            if (longest < 0.0101) break;
        }
        shell_scene_number(&p.s, "levels", 3);
        shell_scene_number(&p.s, "start_level", level < 3 ? level : 0);
        shell_scene_number(&p.s, "k_shape_N_m", 0);
        shell_scene_number(&p.s, "thickness_m", 0.002);
        REQUIRE(shell_plan_open(&p));
        if (level == 3) shell_plan_mix(&p, 40);
        const pal_component *row = shell_plan_row(&p, "edge_spring");
        const double strain = 1e-5, area = pal_surface_area(surface), E2D = 5000 * 0.002;
        for (int turn = 0; turn < 6; turn++) {
            double c = cos(0.3 * turn), s = sin(0.3 * turn);
            for (int k = 0; k < p.body->n_active; k++) {
                double *x = p.body->x + 3 * pal_body_point(p.body, k);
                const double *r = p.body->x_rest + 3 * pal_body_point(p.body, k);
                double along = strain * (c * r[0] + s * r[1]), across = -strain / 3 * (c * r[1] - s * r[0]);
                x[0] = r[0] + c * along - s * across;
                x[1] = r[1] + s * along + c * across;
            }
            double J = row->effect->energy(row->self, p.body);
            CHECK_NEAR(J / (0.5 * E2D * strain * strain * area), 1, level == 0 ? 1e-4 : 0.007);
            /* uniaxial tension: the stress is E e at every node but those of rounded corners */
            CHECK_NEAR(field_mean(&p, PAL_FIELD_VON_MISES_PA) / (5000 * strain), 1, level == 0 ? 1e-4 : 0.007);
            CHECK_NEAR(field_mean(&p, PAL_FIELD_STRAIN) / strain, 1, 1e-4);
            CHECK_NEAR(field_mean(&p, PAL_FIELD_YOUNG_PA), 5000, 1e-6);
        }
        shell_plan_close(&p);
    }
}

/* square cells cut alike: along x, free to shear, only the springs along x bear: sqrt(3)/2 of the modulus */
static void fabric_of_square_cells_bears_seven_eighths_along_its_threads(void)
{
    shell_plan p;
    shell_plan_sheet(&p, 9, 9, 0.08, 0.08);
    shell_scene_number(&p.s, "levels", 3);
    shell_scene_number(&p.s, "k_shape_N_m", 0);
    REQUIRE(shell_plan_open(&p));
    shell_plan_mix(&p, 40);
    const pal_component *row = shell_plan_row(&p, "edge_spring");
    const double strain = 1e-5, area = 0.08 * 0.08;
    double min = INFINITY;
    for (int way = -1; way <= 1; way += 2) {
        for (int k = 0; k < p.body->n_active; k++) {
            double *x = p.body->x + 3 * pal_body_point(p.body, k);
            const double *r = p.body->x_rest + 3 * pal_body_point(p.body, k);
            x[0] = r[0] + strain * (r[0] + way * r[1]);
            x[1] = r[1];
        }
        min = fmin(min, row->effect->energy(row->self, p.body));
    }
    CHECK_NEAR(min / (0.5 * 5000 * 0.003 * strain * strain * area), sqrt(3) / 2, 1e-4);
    shell_plan_close(&p);
}

/* paper C, eq. 8: KS_l = 2^l KS_0 m_l/m_0, damping alike */
static void paper_law_softens_by_level(void)
{
    for (int level = 0; level < 3; level++) {
        shell_plan p;
        shell_plan_sphere(&p);
        shell_scene_number(&p.s, "levels", 3);
        shell_scene_number(&p.s, "start_level", level);
        shell_scene_number(&p.s, "k_shape_N_m", 0);
        shell_scene_number(&p.s, "k_spring_N_m", 10);
        shell_scene_number(&p.s, "c_spring_Ns_m", 0.1);
        shell_scene_text(&p.s, "law", "paper");
        REQUIRE(shell_plan_open(&p));
        const int n[3] = {114, 450, 1794};
        double share = (1 << level) * 114.0 / n[level], sum = 0, damp = 0;
        double *bound = calloc(2 * (size_t)p.body->n_node, sizeof *bound), *c_bound = bound + p.body->n_node;
        const pal_component *row = shell_plan_row(&p, "edge_spring");
        row->effect->bounds.stiffness(row->self, p.body, bound);
        row->effect->bounds.damping(row->self, p.body, c_bound);
        for (int i = 0; i < p.body->n_node; i++) sum += bound[i], damp += c_bound[i];
        CHECK_NEAR(sum / (4 * 10 * p.adaptive->n_spring * share), 1, 1e-6);
        CHECK_NEAR(damp / (4 * 0.1 * p.adaptive->n_spring * share), 1, 1e-6);
        free(bound);
        shell_plan_close(&p);
    }
}

/* rows of the Hessian by differences: sums of norms of their 3 x 3 blocks are never above the bound */
static void stiffness_bounds_the_rows_of_the_hessian(void)
{
    shell_plan p;
    REQUIRE(open_mixture(&p, 2, "membrane", 0));
    const pal_component *row = shell_plan_row(&p, "edge_spring");
    size_t n = 3 * (size_t)p.body->n_node;
    double *bound = calloc(n, sizeof *bound), *sum = calloc(n, sizeof *sum), *up = calloc(n, sizeof *up);
    shell_plan_shake(&p, 0.05, 0);
    row->effect->bounds.stiffness(row->self, p.body, bound);
    double step = 1e-7 * p.body->edge_m, tight = 0;
    for (int k = 0; k < p.body->n_active; k++)
        for (int c = 0; c < 3; c++) {
            int i = 3 * pal_body_point(p.body, k) + c;
            double x = p.body->x[i];
            p.body->x[i] = x + step;
            shell_plan_force(&p, row);
            memcpy(up, p.body->f, n * sizeof *up);
            p.body->x[i] = x - step;
            shell_plan_force(&p, row);
            p.body->x[i] = x;
            /* column i is row i */
            for (size_t j = 0; j < n; j += 3) {
                double h2 = 0;
                for (size_t q = j; q < j + 3; q++) h2 += pow((p.body->f[q] - up[q]) / (2 * step), 2);
                sum[i] += sqrt(h2);
            }
        }
    int above = 0;
    for (int i = 0; i < 3 * p.body->n_node; i++) {
        if (!(bound[i / 3] > 0)) continue;
        above += sum[i] > bound[i / 3] * 1.0001;
        tight = fmax(tight, sum[i] / bound[i / 3]);
    }
    CHECK_INT(above, 0);
    CHECK(tight > 0.5);
    free(bound), free(sum), free(up);
    shell_plan_close(&p);
}

static void material_edits_and_regions_reach_the_springs(void)
{
    for (int given = 0; given < 2; given++) {
        shell_plan p;
        shell_plan_sheet(&p, 9, 9, 0.08, 0.08);
        shell_scene_number(&p.s, "levels", 2);
        if (given) shell_scene_number(&p.s, "k_spring_N_m", 10);
        pal_body_def *def = &p.s.scene->body[0];
        /* the half x > 0 is three times as stiff */
        def->n_region = 1;
        def->region[0] = (pal_region){.kind = PAL_REGION_BOX,
                                      .young_Pa = 15000,
                                      .poisson = NAN,
                                      .density_kg_m3 = NAN,
                                      .low_m = {1e-6, -1, -1},
                                      .high_m = {1, 1, 1}};
        REQUIRE(shell_plan_open(&p));
        const pal_component *row = shell_plan_row(&p, "edge_spring");
        double k = given ? 10 : sqrt(3) / 2 * 5000 * 0.003, J[2];
        pal_material to = def->material;
        for (int edit = 0; edit < 2; edit++) {
            /* the edit leaves the region's E and constants that were given */
            for (int half = 0; half < 2; half++) {
                shell_plan_shake(&p, 0, 0);
                for (int i = 0; i < p.body->n_node; i++)
                    if ((p.body->x_rest[3 * i] > 0) == half) p.body->x[3 * i + 1] *= 1.00001;
                J[half] = 0;
                for (int s = 0; s < p.adaptive->n_spring; s++) {
                    const int32_t *e = p.adaptive->levels.edge[p.adaptive->spring[s]].vertex;
                    const double *a = p.body->x_rest + 3 * e[0], *b = p.body->x_rest + 3 * e[1];
                    double l0 = pal_dist3(a, b), l = pal_dist3(p.body->x + 3 * e[0], p.body->x + 3 * e[1]);
                    double ratio = a[0] + b[0] > 2e-6 ? 15000 / (given ? 5000 : to.young_Pa) : 1;
                    J[half] += 0.5 * k * ratio * (double)p.adaptive->spring_share[s] * (l - l0) * (l - l0);
                }
                CHECK_NEAR(row->effect->energy(row->self, p.body) / J[half], 1, 1e-6);
            }
            CHECK(J[0] > 0 && J[1] > 0);
            to.young_Pa = 10000;
            CHECK_INT(row->effect->material(row->self, p.body, &to, NULL), 0);
            if (!given) k *= 2;
        }
        shell_plan_close(&p);
    }
}

static void the_same_state_gives_the_same_bits(void)
{
    shell_plan p, q;
    REQUIRE(open_mixture(&p, 1, "membrane", 0.05) && open_mixture(&q, 1, "membrane", 0.05));
    const pal_component *row = shell_plan_row(&p, "edge_spring");
    size_t n = 3 * sizeof(double) * (size_t)p.body->n_node;
    double *first = malloc(n);
    /* q comes to the state by another way */
    int32_t leaf = q.adaptive->leaf[0];
    if (pal_adaptive_split(q.adaptive, q.body, leaf, 0)) {
        pal_adaptive_update(q.adaptive, q.body);
        shell_plan_force(&q, shell_plan_row(&q, "edge_spring"));
        CHECK(pal_adaptive_join(q.adaptive, q.body, leaf));
        pal_adaptive_update(q.adaptive, q.body);
    }
    p.seed = q.seed = 3;
    shell_plan_shake(&p, 0.2, 1);
    shell_plan_shake(&q, 0.2, 1);
    shell_plan_force(&p, row);
    memcpy(first, p.body->f, n);
    shell_plan_force(&p, row);
    CHECK(!memcmp(first, p.body->f, n));
    shell_plan_force(&q, shell_plan_row(&q, "edge_spring"));
    CHECK(!memcmp(first, q.body->f, n));
    free(first);
    shell_plan_close(&p);
    shell_plan_close(&q);
}

static void other_bodies_and_implicit_solvers_are_refused(void)
{
    pal_prepared box;
    pal_plan plan;
    pal_diagnostic diag = {{0}};
    REQUIRE(!box_make(2, 2, 2, 0.01, &box));
    pal_scene *scene = box_scene(&box, false, false);
    pal_entry_init(&scene->body[0].effect[scene->body[0].n_effect++], "effects[1]", "edge_spring");
    pal_arena *arena = pal_arena_create(1 << 20, true);
    CHECK_INT(pal_plan_build(scene, arena, &diag, &plan), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "effects[1]: \"edge_spring\" needs a body of model adaptive_springs");
    pal_arena_destroy(arena);
    free(scene);
    box_free(&box);

    shell_plan p;
    shell_plan_sphere(&p);
    pal_entry_init(&p.s.scene->body[0].solver, "solver", "implicit_euler");
    p.arena = pal_arena_create(1 << 20, true);
    CHECK_INT(pal_plan_build(p.s.scene, p.arena, &p.s.diag, &p.plan), PAL_ERR_REFUSED);
    CHECK_TEXT(p.s.diag.text, "body \"shell\": row \"edge_spring\" has no tangent, which its implicit solver needs");
    shell_plan_close(&p);
}

int main(void)
{
    RUN(force_is_minus_the_gradient_of_energy);
    RUN(no_net_force_or_torque_whatever_the_motion);
    RUN(rest_force_is_zero_on_every_mixture);
    RUN(damping_takes_energy_and_leaves_momentum);
    RUN(springs_without_length_push_open);
    RUN(sheet_of_equilateral_triangles_stretches_as_its_material);
    RUN(energy_of_the_leaves_is_that_of_the_springs);
    RUN(fabric_of_square_cells_bears_seven_eighths_along_its_threads);
    RUN(paper_law_softens_by_level);
    RUN(stiffness_bounds_the_rows_of_the_hessian);
    RUN(material_edits_and_regions_reach_the_springs);
    RUN(the_same_state_gives_the_same_bits);
    RUN(other_bodies_and_implicit_solvers_are_refused);
    return check_report();
}
