/* Adaptive surfaces: stiffness over mixtures of levels, where new nodes stand, the rigid frame. */
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "tests/fixtures/adaptive_moves.h"
#include "tests/stability/hard_case.h"

/* ---- stiffness ---- */

static double energy(const thing *t)
{
    const pal_adaptive_surface *s = t->adaptive;
    double sum = 0;
    for (int k = 0; k < s->n_spring; k++) {
        const int32_t *v = s->levels.edge[s->spring[k]].vertex;
        double now = pal_dist3(t->body.x + 3 * v[0], t->body.x + 3 * v[1]);
        double rest = pal_dist3(t->body.x_rest + 3 * v[0], t->body.x_rest + 3 * v[1]);
        sum += 0.5 * (double)s->spring_share[k] * (now - rest) * (now - rest);
    }
    return sum;
}

static void stretch(thing *t, bool only_coarse)
{
    for (int k = 0; k < (only_coarse ? t->adaptive->levels.n_vertex[0] : t->body.n_active); k++) {
        const int i = t->body.active[k];
        const double *r = t->body.x_rest + 3 * i;
        pal_set3(t->body.x + 3 * i, 1.1 * r[0] + 0.04 * r[1], 0.95 * r[1] - 0.02 * r[0], 0.03 * r[0]);
    }
}

/* erratum C4: any mixture of levels bears a uniform stretch as the coarse sheet does, and splitting keeps it */
static void a_uniform_stretch_has_one_energy_on_every_mixture(void)
{
    for (int placed = 0; placed < 2; placed++) {
        thing t = make(SHEET, (pal_adaptive_options){.n_level = 4, .place = (pal_midpoint_placement)placed});
        dice d = {.seed = 31};
        stretch(&t, false);
        double want = energy(&t), worst = 0;
        CHECK(want > 1e-6);
        for (int round = 0; round < 100; round++) {
            stir(&t, &d, 6, 0);
            pal_adaptive_update(t.adaptive, &t.body);
            /* as splitting left it, then as the map has it */
            worst = fmax(worst, fabs(energy(&t) / want - 1));
            stretch(&t, false);
            worst = fmax(worst, fabs(energy(&t) / want - 1));
        }
        CHECK(t.adaptive->n_leaf_of[1] > 0 && t.adaptive->n_leaf_of[3] > 0);
        HARD_CASE("hanging", "adaptive_springs", "energy of a uniform stretch on 100 mixtures of levels off by", worst,
                  1e-6, "");
        CHECK_LE(worst, 1e-12);
        give_back(&t);
    }
}

static void the_law_of_the_paper_halves_stiffness_each_level(void)
{
    thing t = make(SPHERE, (pal_adaptive_options){.n_level = 3, .law = PAL_ADAPTIVE_PAPER});
    for (int level = 0; level < 3; level++) {
        pal_adaptive_set_level(t.adaptive, &t.body, level);
        pal_adaptive_update(t.adaptive, &t.body);
        /* 2^l m_l / m_0 = 2^l N_0 / N_l, eq. 8 */
        const double want[3] = {1, 2.0 * 114 / 450, 4.0 * 114 / 1794};
        for (int k = 0; k < t.adaptive->n_spring; k++)
            if (fabs((double)t.adaptive->spring_share[k] - want[level]) > 1e-7) CHECK_FAIL("spring %d", k);
        CHECK_NEAR(t.adaptive->level_mass_kg[level], 0.3 / t.adaptive->n_node, 1e-15);
    }
    give_back(&t);
}

static void springs_of_the_membrane_law_follow_their_faces(void)
{
    thing t = make(SHEET, (pal_adaptive_options){.n_level = 2});
    const pal_adaptive_surface *s = t.adaptive;
    pal_adaptive_split(t.adaptive, &t.body, 20, 0);
    pal_adaptive_update(t.adaptive, &t.body);
    int count[4] = {0};
    for (int k = 0; k < s->n_spring; k++) {
        int share = (int)(2 * s->spring_share[k]);
        bool fine = s->levels.edge_level[s->spring[k]] == 1;
        if (share < 0 || share > 3 || (share == 3 && !fine)) CHECK_FAIL("share %g", (double)s->spring_share[k]);
        count[share & 3]++;
    }
    /* 7 x 5 vertices: 20 edges of the rim bear half; three split edges give six halves beside coarse faces */
    CHECK_INT(count[1], 20);
    CHECK_INT(count[3], 6);
    CHECK_INT(count[0], 0);
    CHECK_INT(s->n_spring, 82 - 3 + 6 + 3);
    give_back(&t);
}

/* ---- placement ---- */

static void turn_body(thing *t, double angle, int n)
{
    const double axis[3] = {0.6, -0.48, 0.64};
    double q[4] = {cos(0.5 * angle), sin(0.5 * angle) * axis[0], sin(0.5 * angle) * axis[1],
                   sin(0.5 * angle) * axis[2]};
    const double move[3] = {0.3, -0.2, 0.1}, spin[3] = {3, -2, 5};
    for (int k = 0; k < n; k++) {
        int i = t->body.active[k];
        pal_quat_rotate(t->body.x + 3 * i, q, t->body.x_rest + 3 * i);
        pal_add3(t->body.x + 3 * i, t->body.x + 3 * i, move);
        pal_cross3(t->body.v + 3 * i, spin, t->body.x + 3 * i);
    }
}

static void new_nodes_of_a_turned_body_stand_as_at_rest(void)
{
    for (int placed = 0; placed < 2; placed++)
        for (int shape = SPHERE; shape <= SHEET; shape++) {
            thing t = make(shape, (pal_adaptive_options){.n_level = 4, .place = (pal_midpoint_placement)placed});
            dice d = {.seed = 41};
            double worst = 0;
            turn_body(&t, 2.5, t.body.n_active);
            for (int k = 0; k < 10; k++) stir(&t, &d, 20, 0), pal_adaptive_update(t.adaptive, &t.body);
            thing u = make(shape, (pal_adaptive_options){.n_level = 4, .start_level = 3});
            turn_body(&u, 2.5, u.body.n_active);
            for (int k = 0; k < t.body.n_active; k++)
                worst = fmax(worst, pal_dist3(t.body.x + 3 * t.body.active[k], u.body.x + 3 * t.body.active[k]));
            CHECK(t.adaptive->n_leaf_of[3] > 0);
            CHECK_LE(worst, 1e-14);
            give_back(&t);
            give_back(&u);
        }
}

static void velocity_of_a_new_node_is_the_mean_of_its_edge(void)
{
    thing t = make(SPHERE, (pal_adaptive_options){.n_level = 2});
    const pal_levels *l = &t.adaptive->levels;
    shake(&t, 3);
    for (int32_t f = 0; f < 224; f += 5) pal_adaptive_split(t.adaptive, &t.body, f, 0);
    pal_adaptive_update(t.adaptive, &t.body);
    for (int k = 0; k < t.body.n_active; k++) {
        const int32_t v = t.body.active[k];
        if (v < l->n_vertex[0]) continue;
        const int32_t *end = l->edge[pal_levels_vertex_parent(l, v)].vertex;
        for (int c = 0; c < 3; c++)
            CHECK_NEAR(t.body.v[3 * v + c], 0.5 * (t.body.v[3 * end[0] + c] + t.body.v[3 * end[1] + c]), 1e-16);
        /* and within the edge's own length of its middle */
        CHECK(pal_dist3(t.body.x + 3 * v, t.body.x + 3 * end[0]) < 0.03);
    }
    give_back(&t);
}

static void collapsed_bodies_split_to_finite_places(void)
{
    const double squash[7][3] = {{0, 0, 0},    {1, 0, 0}, {-1, 0, 0}, {1, 1, 0}, {1, 1, -1}, {1e-200, 1e-200, 1e-200},
                                 {1e160, 1, 1}};
    for (int k = 0; k < 28; k++) {
        thing t = make(k & 1 ? STOMACH : SHEET,
                       (pal_adaptive_options){.n_level = 3, .place = (pal_midpoint_placement)(k >> 1 & 1)});
        const pal_levels *l = &t.adaptive->levels;
        dice d = {.seed = 51};
        for (int i = 0; i < 3 * l->n_vertex[0]; i++) t.body.x[i] = squash[k / 4][i % 3] * t.body.x_rest[i];
        for (int n = 0; n < 5; n++) stir(&t, &d, 60, 0), pal_adaptive_update(t.adaptive, &t.body);
        CHECK(t.adaptive->finest == 2 && pal_body_finite(&t.body));
        /* in a point there is nothing to turn by: the offset is that at rest */
        for (int32_t v = l->n_vertex[0]; k == 1 && v < l->n_vertex[1]; v++) {
            const int32_t *end = l->edge[pal_levels_vertex_parent(l, v)].vertex;
            if (!pal_adaptive_has(t.adaptive, v)) continue;
            for (int c = 0; c < 3; c++)
                CHECK_NEAR(t.body.x[3 * v + c], l->x[3 * v + c] - 0.5 * (l->x[3 * end[0] + c] + l->x[3 * end[1] + c]),
                           1e-16);
        }
        give_back(&t);
    }
}

/* with both ends held, with one, with none */
static void fixed_midpoints_have_the_displacement_of_their_fixed_ends(void)
{
    for (int n_fixed = 0; n_fixed <= 2; n_fixed++) {
        thing t = make(SHEET, (pal_adaptive_options){.n_level = 2});
        const pal_levels *l = &t.adaptive->levels;
        const int32_t e = l->face_edge[3 * 20], mid = pal_levels_edge_midpoint(l, e);
        t.body.support[mid] = 1;
        for (int k = 0; k < n_fixed; k++) t.body.support[l->edge[e].vertex[k]] = 1;
        for (int i = 0; i < 35; i++) t.body.x[3 * i] += 0.01, t.body.v[3 * i] = 1;
        CHECK_INT(pal_adaptive_split(t.adaptive, &t.body, 20, 0), 1);
        CHECK_NEAR(t.body.x[3 * mid] - t.body.x_rest[3 * mid], n_fixed > 0 ? 0.01 : 0, 1e-15);
        CHECK_NEAR(t.body.v[3 * mid], 0, 0);
        give_back(&t);
    }
}

/* ---- the rigid frame ---- */

static void the_frame_is_that_of_a_rigid_motion(void)
{
    for (int shape = SPHERE; shape <= SHEET; shape++) {
        thing t = make(shape, (pal_adaptive_options){.n_level = 3});
        dice d = {.seed = 81};
        for (int k = 0; k < 3; k++) stir(&t, &d, 40, 0), pal_adaptive_update(t.adaptive, &t.body);
        double worst_R = 0, worst_x = 0, worst_v = 0;
        for (int step = 0; step <= 36; step++) {
            double angle = 3.14159265358979323846 * step / 36;
            turn_body(&t, angle, t.body.n_active);
            /* from nothing, however far it turned */
            pal_rigid_fit frame = {.quat = {1}};
            pal_adaptive_fit_rigid(t.adaptive, &t.body, &frame);
            const double axis[3] = {0.6, -0.48, 0.64}, h = 0.5 * angle;
            double q[4] = {cos(h), sin(h) * axis[0], sin(h) * axis[1], sin(h) * axis[2]}, R[9];
            pal_quat_matrix(q, R);
            for (int k = 0; k < 9; k++) worst_R = fmax(worst_R, fabs(R[k] - frame.R[k]));
            for (int k = 0; k < t.body.n_active; k++) {
                const int i = 3 * t.body.active[k];
                double arm[3], at[3], v[3];
                pal_sub3(arm, t.body.x_rest + i, frame.rest_centre_m);
                pal_mul33(at, frame.R, arm);
                pal_cross3(v, frame.Omega_1_s, at);
                pal_add3(at, at, frame.centre_m), pal_add3(v, v, frame.V_m_s);
                worst_x = fmax(worst_x, pal_dist3(at, t.body.x + i));
                worst_v = fmax(worst_v, pal_dist3(v, t.body.v + i));
            }
        }
        CHECK_LE(worst_R, 1e-11);
        CHECK_LE(worst_x, 1e-12);
        CHECK_LE(worst_v, 1e-11);
        give_back(&t);
    }
}

/* the frame's part of any motion keeps its momentum and angular momentum */
static void the_frame_moves_with_the_momentum_of_the_body(void)
{
    thing t = make(STOMACH, (pal_adaptive_options){.n_level = 2});
    shake(&t, 5);
    pal_rigid_fit frame = {.quat = {1}};
    pal_adaptive_fit_rigid(t.adaptive, &t.body, &frame);
    double p[3] = {0, 0, 0}, l[3] = {0, 0, 0}, size = 0;
    for (int i = 0; i < 188; i++) {
        double arm[3], v[3], turn[3];
        pal_sub3(arm, t.body.x + 3 * i, frame.centre_m);
        pal_cross3(v, frame.Omega_1_s, arm);
        for (int c = 0; c < 3; c++) v[c] = t.body.v[3 * i + c] - frame.V_m_s[c] - v[c];
        pal_axpy3(p, t.body.mass_kg[i], v);
        pal_cross3(turn, arm, v);
        pal_axpy3(l, t.body.mass_kg[i], turn);
        size += t.body.mass_kg[i] * pal_norm3(v);
    }
    CHECK(size > 0.01);
    CHECK_LE(pal_norm3(p) / size, 1e-13);
    CHECK_LE(pal_norm3(l) / size, 1e-13);
    give_back(&t);
}

static void collapsed_bodies_keep_their_last_frame(void)
{
    thing t = make(SPHERE, (pal_adaptive_options){.n_level = 2});
    turn_body(&t, 1.2, 114);
    pal_rigid_fit frame = {.quat = {1}}, last;
    pal_adaptive_fit_rigid(t.adaptive, &t.body, &frame);
    last = frame;
    /* to a point, moving; twice, as it should stay there */
    for (int i = 0; i < 114; i++) {
        pal_set3(t.body.x + 3 * i, 0.1, 0.2, 0.3);
        pal_set3(t.body.v + 3 * i, 1, 2, 3 + 0.1 * (i % 2));
    }
    for (int k = 0; k < 2; k++) {
        pal_adaptive_fit_rigid(t.adaptive, &t.body, &frame);
        /* by rounding no two points are the same */
        for (int i = 0; i < 3 * 114; i++) t.body.x[i] *= 1 + 4e-16 * (pal_random_unit(9, (uint64_t)i) - 0.5);
    }
    CHECK(!memcmp(frame.quat, last.quat, sizeof last.quat));
    CHECK_NEAR(frame.centre_m[2], 0.3, 1e-15);
    CHECK(pal_finite3(frame.Omega_1_s) && pal_norm3(frame.Omega_1_s) == 0);
    /* to a line along x, that turns about z and not about itself */
    for (int i = 0; i < 114; i++) {
        pal_set3(t.body.x + 3 * i, t.body.x_rest[3 * i], 0, 0);
        pal_set3(t.body.v + 3 * i, 0, 2 * t.body.x_rest[3 * i], 0);
    }
    pal_rigid_fit on = {.quat = {1}};
    pal_adaptive_fit_rigid(t.adaptive, &t.body, &on);
    CHECK_NEAR(on.quat[0], 1, 1e-6);
    CHECK_NEAR(on.Omega_1_s[0], 0, 1e-12);
    CHECK_NEAR(on.Omega_1_s[2], 2, 1e-12);
    /* and what is no number leaves the rotation alone */
    t.body.x[5] = (double)NAN;
    last = on;
    pal_adaptive_fit_rigid(t.adaptive, &t.body, &on);
    CHECK(!memcmp(on.quat, last.quat, sizeof last.quat));
    give_back(&t);
}

int main(void)
{
    RUN(a_uniform_stretch_has_one_energy_on_every_mixture);
    RUN(the_law_of_the_paper_halves_stiffness_each_level);
    RUN(springs_of_the_membrane_law_follow_their_faces);
    RUN(new_nodes_of_a_turned_body_stand_as_at_rest);
    RUN(velocity_of_a_new_node_is_the_mean_of_its_edge);
    RUN(collapsed_bodies_split_to_finite_places);
    RUN(fixed_midpoints_have_the_displacement_of_their_fixed_ends);
    RUN(the_frame_is_that_of_a_rigid_motion);
    RUN(the_frame_moves_with_the_momentum_of_the_body);
    RUN(collapsed_bodies_keep_their_last_frame);
    return check_report();
}
