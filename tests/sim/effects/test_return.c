/* A body released from its slowest mode returns in the time that its lowest frequency and its drag predict, with a
 * derived damping and with one that is far above critical; and what sleep freezes is next to nothing. */
#include "server/base/vec3.h"
#include "server/sim/effects/tuning.h"
#include "tests/fixtures/model_scenes.h"

static pal_diagnostic diag;

/* time at which u'' + c u' + w^2 u = 0, released at 1, has fallen to `part`, for c >= 2 w */
static double fall_s(double c, double w, double part)
{
    const double d = sqrt(fmax(0.25 * c * c - w * w, 0)), fast = 0.5 * c + d, slow = w * w / fast;
    double low = 0, high = 100 * fast / (w * w);
    for (int k = 0; k < 100; k++) {
        const double t = 0.5 * (low + high);
        const double u = d > 1e-3 * c ? (fast * exp(-slow * t) - slow * exp(-fast * t)) / (fast - slow)
                                      : (1 + 0.5 * c * t) * exp(-0.5 * c * t);
        *(u > part ? &low : &high) = t;
    }
    return low;
}

/* mass-weighted part of the mode in the displacement */
static double part_of(const pal_body *body, const double *mode)
{
    double dot = 0, norm = 0;
    for (int i = 0; i < 3 * body->n_dof; i++) {
        dot += body->mass_kg[i / 3] * mode[i] * (body->x[i] - body->x_rest[i]);
        norm += body->mass_kg[i / 3] * mode[i] * mode[i];
    }
    return dot / norm;
}

static double longest_m(const pal_body *body, const double *from, const double *to)
{
    double longest = 0;
    for (int i = 0; i < body->n_dof; i++) longest = fmax(longest, pal_dist3(from + 3 * (size_t)i, to + 3 * (size_t)i));
    return longest;
}

/* released from 5 % S of the mode; E is chosen so that w1 is 0.5 1/s */
static void release(int kind, double damping_1_s)
{
    model_scene m;
    const double wanted_1_s = 0.5;
    model_scene_make(&m, (model_kind)kind);
    model_scene_effect(&m, "sleep");
    m.def->material.damping_1_s = damping_1_s, m.def->material.damping_ratio = 1;
    REQUIRE(model_scene_open(&m));
    m.def->material.young_Pa *= pow(wanted_1_s / m.body->lowest_1_s, 2);
    pal_world_destroy(m.world);
    REQUIRE(model_scene_open(&m));
    pal_body *body = m.body;
    CHECK_NEAR(body->lowest_1_s / wanted_1_s, 1, 0.01);
    const double c = damping_1_s > 0 ? damping_1_s : 2 * body->lowest_1_s, S = body->length_scale_m;
    CHECK_NEAR(body->damping_1_s / c, 1, 1e-6);
    CHECK_NEAR(pal_body_return_s(body), fmax(c / pow(body->lowest_1_s, 2), 1 / body->lowest_1_s), 1e-9);

    const size_t n = 3 * (size_t)body->n_dof;
    double *mode = calloc(2 * n, sizeof *mode), *zero = mode ? mode + n : NULL, tenth_s = 0, begin = 0;
    REQUIRE(mode);
    REQUIRE(!pal_world_find_lowest(m.world, 0, mode));
    const double scale = 0.05 * S / longest_m(body, mode, zero);
    for (size_t i = 0; i < n; i++) mode[i] *= scale, body->x[i] += mode[i];
    pal_world_invalidate_limits(m.world, 0);
    begin = part_of(body, mode);
    CHECK_NEAR(begin, 1, 1e-9);
    /* the anchors of an adaptive surface have dampers of their own, of ratio 0.3 */
    const double all_1_s = c + (kind == SHELL ? 2 * 0.3 * body->lowest_1_s : 0);
    const double predicted_s = fall_s(all_1_s, body->lowest_1_s, 0.1);
    const double longest_s = fall_s(all_1_s, body->lowest_1_s, 1e-4) + 10;
    double t = 0;
    for (; t < longest_s && !body->asleep; t += m.scene->step_s) {
        REQUIRE(!pal_world_step(m.world, m.scene->step_s));
        if (tenth_s == 0 && part_of(body, mode) < 0.1) tenth_s = t + m.scene->step_s;
    }
    const double left = longest_m(body, body->x, body->x_rest) / S;
    printf("  %s, drag %.3g 1/s: a tenth after %.2f s of %.2f, asleep after %.1f s, %.2g S from rest\n",
           model_kind_name[kind], c, tenth_s, predicted_s, t, left);
    CHECK_NEAR(tenth_s / predicted_s, 1, 0.2);
    CHECK(body->asleep);
    CHECK_LE(left, 2 * PAL_SLEEP_ERROR_S);
    free(mode);
    model_scene_close(&m);
}

static void with_a_derived_damping(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) release(k, PAL_DAMPING_DERIVED);
}

static void with_a_drag_far_above_critical(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) release(k, 4);
}

/* the limits are lowered for slow bodies and never raised: a fast one sleeps by the keys */
static void a_fast_body_sleeps_by_its_keys(void)
{
    for (int fast = 0; fast < 2; fast++) {
        model_scene m;
        model_scene_make(&m, FEM);
        pal_config_entry *sleep = model_scene_effect(&m, "sleep");
        CHECK_INT(pal_entry_put_number(sleep, "speed_1_s", fast ? 1e-9 : 1e-4, &diag), 0);
        REQUIRE(model_scene_open(&m));
        CHECK(m.body->lowest_1_s > 2);
        /* a little faster than 1e-9 S/s for some seconds */
        for (int i = 0; i < m.body->n_dof; i++)
            if (!m.body->support[i]) m.body->x[3 * i] += 2e-5 * m.body->length_scale_m;
        pal_world_invalidate_limits(m.world, 0);
        double t = 0;
        for (; t < 20 && !m.body->asleep; t += m.scene->step_s) REQUIRE(!pal_world_step(m.world, m.scene->step_s));
        printf("  asleep after %.2f s\n", t);
        CHECK(fast ? t > 1.5 : t < 1.0);
        model_scene_close(&m);
    }
}

int main(void)
{
    RUN(with_a_derived_damping);
    RUN(with_a_drag_far_above_critical);
    RUN(a_fast_body_sleeps_by_its_keys);
    return check_report();
}
