/* Which commands the motion of a device makes of a brush. */
#include "clients/haptic_bridge/hand_brush.h"
#include "tests/check.h"

#include <math.h>
#include <string.h>

static const double up_N[3] = {0, 0, 0.2};

static double number(const pal_wire_command *c, const char *key)
{
    for (uint32_t k = 0; k < c->n_arg; k++)
        if (!strcmp(c->arg[k].key, key)) return c->arg[k].value;
    return NAN;
}

static pal_hand_brush brush(const char *text)
{
    pal_hand_brush b = {.kind = PAL_HAND_GRASP};
    pal_diagnostic diag = {""};
    if (pal_hand_brush_parse(text, &b, &diag)) CHECK_FAIL("%s", diag.text);
    return b;
}

/* takes and answers; false: there is none */
static bool next(pal_hand_brush *b, const char *verb, pal_wire_command *c)
{
    if (!pal_hand_brush_take(b, c)) return false;
    pal_hand_brush_answered(b);
    CHECK(!strcmp(c->verb, verb));
    return true;
}

/* from x along z to z_m, in steps of 0.1 mm, with the button */
static void along_z(pal_hand_brush *b, double z_m, double x[3])
{
    const int n = (int)lround(fabs(z_m - x[2]) / 1e-4);
    const double step = (z_m - x[2]) / n;
    for (int k = 0; k < n; k++) {
        x[2] += step;
        pal_hand_brush_move(b, true, x, x[2] > 0 ? NULL : up_N);
    }
}

static void a_pressure_follows_the_hand_and_ends_with_the_button(void)
{
    pal_hand_brush b = brush("inflate,radius=10,strength=1000");
    pal_wire_command c;
    double x[3] = {0.01, 0.02, 0};
    pal_hand_brush_move(&b, true, x, NULL);
    CHECK(!b.held); /* it does not touch */
    pal_hand_brush_move(&b, true, x, up_N);
    CHECK(b.held && !pal_hand_brush_take(&b, &c));
    along_z(&b, 0.005, x);
    REQUIRE(next(&b, "inflate", &c));
    CHECK(number(&c, "x_m") == 0.01 && number(&c, "y_m") == 0.02 && number(&c, "z_m") == 0);
    CHECK_NEAR(number(&c, "radius_m"), 0.01, 1e-12);
    CHECK_NEAR(number(&c, "pressure_Pa"), 500, 51); /* 0.5 radius, within a step of the hand */
    CHECK(!pal_hand_brush_take(&b, &c));            /* the newest replaced those before */
    along_z(&b, -0.01, x);
    REQUIRE(next(&b, "inflate", &c));
    CHECK_NEAR(number(&c, "pressure_Pa"), -1000, 51);
    along_z(&b, -0.002, x);
    pal_hand_brush_move(&b, false, x, NULL);
    REQUIRE(next(&b, "release", &c));
    CHECK(!b.held && !pal_hand_brush_take(&b, &c));
}

static void one_command_is_under_way_at_a_time(void)
{
    pal_hand_brush b = brush("paint,radius=10,strength=3");
    pal_wire_command c;
    double x[3] = {0, 0, 0};
    pal_hand_brush_move(&b, true, x, up_N);
    for (int k = 0; k < 210; k++) {
        x[0] += 1e-4;
        pal_hand_brush_move(&b, true, x, up_N);
    }
    pal_hand_brush_move(&b, false, x, up_N);
    REQUIRE(pal_hand_brush_take(&b, &c));
    CHECK(!strcmp(c.verb, "paint") && number(&c, "x_m") == 0 && number(&c, "young_factor") == 3);
    CHECK(!pal_hand_brush_take(&b, &c));
    pal_hand_brush_answered(&b);
    /* 21 mm in dabs of 5 mm */
    for (int k = 1; k <= 4; k++) {
        REQUIRE(next(&b, "paint", &c));
        CHECK_NEAR(number(&c, "x_m"), 0.005 * k, 1.1e-4 * k);
    }
    CHECK(!pal_hand_brush_take(&b, &c));
    for (int k = 0; k < 40; k++) { /* nobody answers: what does not fit is counted */
        x[0] += 0.006;
        pal_hand_brush_move(&b, true, x, up_N);
    }
    CHECK_INT(b.n_queued, PAL_HAND_QUEUE);
    CHECK_INT(b.n_dropped, 40 - PAL_HAND_QUEUE);
    pal_hand_brush_reset(&b);
    CHECK(!b.held && !pal_hand_brush_take(&b, &c));
}

static void a_handle_is_drawn_and_then_pulled(void)
{
    pal_hand_brush b = brush("curve,strength=150");
    pal_wire_command c;
    double x[3] = {0, 0, 0};
    for (int turn = 0; turn < 2; turn++) { /* too short a handle is none */
        const double length_m = turn ? 0.05 : 0.01;
        x[1] = 0;
        pal_hand_brush_move(&b, true, x, up_N);
        x[1] = length_m;
        pal_hand_brush_move(&b, true, x, up_N);
        pal_hand_brush_move(&b, false, x, up_N);
        CHECK(!pal_hand_brush_take(&b, &c) && b.drawn == (turn == 1));
    }
    x[1] = 0.02;
    pal_hand_brush_move(&b, true, x, up_N);
    along_z(&b, 0.012, x);
    REQUIRE(next(&b, "curve", &c));
    CHECK(number(&c, "y_m") == 0 && number(&c, "y2_m") == 0.05 && number(&c, "stiffness_N_m") == 150);
    CHECK_NEAR(number(&c, "dz_m"), 0.012, 1.1e-3);
    CHECK(number(&c, "dx_m") == 0 && number(&c, "dy_m") == 0);
    pal_hand_brush_move(&b, false, x, NULL);
    REQUIRE(next(&b, "release", &c));
    CHECK(!b.drawn);
}

static void a_cell_grows_as_high_as_the_hand_has_moved_out(void)
{
    pal_hand_brush b = brush("extrude");
    pal_wire_command c;
    for (int turn = 0; turn < 2; turn++) {
        double x[3] = {0.1, 0, 0};
        pal_hand_brush_move(&b, true, x, up_N);
        along_z(&b, turn ? -0.02 : 0.03, x);
        CHECK(!pal_hand_brush_take(&b, &c));
        pal_hand_brush_move(&b, false, x, NULL);
        REQUIRE(next(&b, "extrude", &c) == (turn == 0)); /* not inwards */
    }
    CHECK_NEAR(number(&c, "distance_m"), 0.03, 1e-9);
    CHECK(number(&c, "x_m") == 0.1 && number(&c, "scale") == 1);
}

static void wrong_words_are_named(void)
{
    static const char *const bad[] = {
        "dig", "", "inflate,size=3", "paint,strength", "curve,radius=-1", "paint,strength=1e9", "inflate,radius=2x"};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        pal_hand_brush b = {.kind = PAL_HAND_GRASP};
        pal_diagnostic diag = {""};
        CHECK(pal_hand_brush_parse(bad[k], &b, &diag) == PAL_ERR_REFUSED && diag.text[0] && b.kind == PAL_HAND_GRASP);
    }
}

int main(void)
{
    RUN(a_pressure_follows_the_hand_and_ends_with_the_button);
    RUN(one_command_is_under_way_at_a_time);
    RUN(a_handle_is_drawn_and_then_pulled);
    RUN(a_cell_grows_as_high_as_the_hand_has_moved_out);
    RUN(wrong_words_are_named);
    return check_report();
}
