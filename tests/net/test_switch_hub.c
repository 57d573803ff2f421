/* Other configurations over the wire: points of a study and parameters, asked for by clients of a real session that
 * runs; the topology that comes of them, answers, refusals, tools that stay with their holders; before and after
 * sculpting. */
#include "tests/net/command_room.h"
#include "tests/session/sculpt_body.h"

static clay_scene clay;
enum { POINTS = 3 };
static pal_measured_configuration point[POINTS];

/* places of a block of 0.1 m, on its top and beside it */
#define TOP "\"x_m\":0.02,\"y_m\":0.02,\"z_m\":0.05"

static void begin(void)
{
    order_begin(&clay.scene, point, POINTS);
}

static void configuration(int i, const char *model, const char *element, int size)
{
    order_point(&point[i], model, element, size);
    point[i].ms = 1 + i, point[i].error_m = 0.001 / (1 + i);
}

static void two_clients_see_a_point_of_the_study(void)
{
    mem_client a, b;
    begin();
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    join(&b, "Ben", PAL_WIRE_ROLE_TRAINEE, 0);
    char before[64];
    snprintf(before, sizeof before, "%s", part(&a)->asset);
    /* finite elements on voxels: another surface is shown */
    send(&a, "study_point", "\"index\":1");
    until_answers(&a, &b, n_answer(&a) + 1);
    CHECK_INT(a.n_text[PAL_CONTROL_ANSWER], 1);
    if (a.n_text[PAL_CONTROL_ERROR]) printf("  %s\n", trouble(&a));
    WAIT_UNTIL(b.n_text[PAL_CONTROL_TOPOLOGY] >= 1, &a, &b);
    until_frame(&a), until_frame(&b);
    CHECK_INT(part(&a)->epoch, 2);
    CHECK_TEXT(part(&b)->asset, part(&a)->asset);
    CHECK(strcmp(part(&a)->asset, before) != 0);
    CHECK(!part(&a)->is_sculptable);
    CHECK_INT(b.n_text[PAL_CONTROL_ANSWER], 0);
    CHECK(strstr(a.last[PAL_CONTROL_ANSWER].answer.text, "fem hex8_bbar") != NULL);
    /* nothing has pushed it: what energy it has is rounding */
    CHECK_LE(reported(&a, "energy_before_J"), 1e-9);
    CHECK_LE(fabs(reported(&a, "energy_after_J") - reported(&a, "energy_before_J")), 1e-9);
    CHECK(isfinite(reported(&a, "energy_percent")));
    CHECK_LE(reported(&a, "max_move_m"), 0.005);
    /* a parameter of it, and back to the cells, which can be sculpted again */
    CHECK(order(&a, "configure", "\"size\":10,\"tolerance\":0.001"));
    CHECK(strstr(a.last[PAL_CONTROL_ANSWER].answer.text, "10 voxels") != NULL);
    CHECK(order(&a, "study_point", "\"index\":2"));
    WAIT_UNTIL(b.n_text[PAL_CONTROL_TOPOLOGY] >= 3, &a, &b);
    until_frame(&a), until_frame(&b);
    CHECK(part(&a)->is_sculptable);
    CHECK_INT(part(&b)->epoch, 4);
    CHECK(order(&a, "divide", TOP));
    CHECK(reported(&a, "cells") > 8);
    /* what was sculpted is switched as it is, and comes back as it was */
    double cells = reported(&a, "cells");
    CHECK(order(&a, "study_point", "\"index\":1"));
    CHECK(!order(&a, "divide", TOP));
    CHECK(strstr(trouble(&a), "can be sculpted") != NULL);
    CHECK(order(&a, "study_point", "\"index\":0"));
    CHECK(order(&a, "undo", ""));
    CHECK(reported(&a, "cells") < cells);
    mem_end(&a);
    mem_end(&b);
    end();
}

static void tools_stay_with_who_holds_them(void)
{
    mem_client c;
    uint32_t seq = 0;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0); /* whose orders do not depend on the speed of the machine */
    for (int round = 0; round < 3; round++) {
        const double at[3] = {0, 0, 0.12 + 0.01 * round};
        mem_pose(&c, 0, ++seq, at);
        if (round == 1) CHECK(order(&c, "configure", "\"step_ms\":20"));
        UNTIL(c.tools.tool[0].echo_seq == seq, &c, NULL);
        CHECK(c.tools.tool[0].flags & PAL_WIRE_TOOL_HELD);
        CHECK_NEAR((double)c.tools.tool[0].position_m[2], at[2], 1e-6);
        CHECK_INT(c.tools.tool[0].holder, c.last[PAL_CONTROL_HELLO].hello.you_id);
    }
    CHECK_INT(part(&c)->epoch, 2);
    CHECK_INT(c.n_bad, 0);
    mem_end(&c);
    end();
}

static double highest(const mem_client *c)
{
    double max = -1;
    for (uint32_t i = 0; i < c->asset->order->n_vertex; i++) max = fmax(max, (double)c->position_m[3 * i + 2]);
    return max;
}

static void wait_frames(mem_client *c, int n)
{
    const int until = c->n_frame + n;
    UNTIL(c->n_frame >= until, c, NULL);
}

/* a pressure goes on at another number of levels; where nothing can be sculpted it ends, and the answer says so */
static void a_pressure_is_transferred(void)
{
    mem_client c;
    uint32_t seq = 0;
    const double away[3] = {0, 0, 0.2};
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0); /* whose orders do not depend on the speed of the machine */
    mem_pose(&c, 0, ++seq, away);
    double rest = highest(&c);
    CHECK(order(&c, "inflate", TOP ",\"radius_m\":0.04,\"pressure_Pa\":2000"));
    wait_frames(&c, 60);
    double lifted = highest(&c) - rest;
    CHECK(lifted > 0.001);
    CHECK(order(&c, "study_point", "\"index\":2"));
    CHECK_INT((int)reported(&c, "brushes_ended"), 0);
    until_frame(&c);
    wait_frames(&c, 60);
    CHECK_NEAR(highest(&c) - rest, lifted, 0.5 * lifted);
    CHECK(order(&c, "study_point", "\"index\":1"));
    CHECK_INT((int)reported(&c, "brushes_ended"), 1);
    CHECK(strstr(c.last[PAL_CONTROL_ANSWER].answer.text, "brushes that ended: 1") != NULL);
    mem_end(&c);
    end();
}

/* a handle as well: it goes on pulling to where it pulled, and its hand ends it */
static void a_handle_is_transferred(void)
{
    mem_client c;
    uint32_t seq = 0;
    const double away[3] = {0, 0, 0.2};
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0); /* whose orders do not depend on the speed of the machine */
    mem_pose(&c, 0, ++seq, away);
    double rest = highest(&c);
    CHECK(order(&c, "curve",
                "\"x_m\":-0.03,\"y_m\":0.0,\"z_m\":0.05,\"x2_m\":0.03,\"y2_m\":0.0,\"z2_m\":0.05,"
                "\"radius_m\":0.03,\"stiffness_N_m\":200,\"dx_m\":0,\"dy_m\":0,\"dz_m\":0.02"));
    wait_frames(&c, 60);
    double lifted = highest(&c) - rest;
    CHECK(lifted > 0.001);
    CHECK(order(&c, "study_point", "\"index\":2"));
    CHECK_INT((int)reported(&c, "brushes_ended"), 0);
    until_frame(&c);
    wait_frames(&c, 60);
    CHECK_NEAR(highest(&c) - rest, lifted, 0.3 * lifted);
    CHECK(order(&c, "release", ""));
    wait_frames(&c, 90);
    CHECK_LE(highest(&c) - rest, 0.3 * lifted);
    mem_end(&c);
    end();
}

static void what_cannot_be_is_refused_with_a_sentence(void)
{
    static const struct {
        const char *verb, *args, *expected;
    } bad[] = {
        {"study_point", "", "index is missing"},           {"study_point", "\"index\":7", "wanted 0 to 2"},
        {"study_point", "\"index\":0.5", "wanted 0 to 2"}, {"study_point", "\"index\":0,\"size\":3", "takes index"},
        {"configure", "", "takes size step_ms tolerance"}, {"configure", "\"size\":3.5", "is no number of"},
        {"configure", "\"size\":9", "levels, wanted"},     {"configure", "\"step_ms\":1000", "step_s"},
        {"configure", "\"tolerance\":7", "tolerance"}};
    mem_client c, d;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        CHECK(!order(&c, bad[i].verb, bad[i].args));
        CHECK(strstr(trouble(&c), bad[i].expected) != NULL);
        if (!strstr(trouble(&c), bad[i].expected)) printf("  %s\n", trouble(&c));
    }
    CHECK_INT(c.n_text[PAL_CONTROL_TOPOLOGY], 0);
    mem_text(&c, "{\"type\":\"command\",\"verb\":\"study_point\",\"target\":\"stone\",\"args\":{\"index\":1}}");
    until_answers(&c, NULL, n_answer(&c) + 1);
    CHECK(strstr(trouble(&c), "stone") != NULL);
    mem_text(&c, "{\"type\":\"command\",\"verb\":\"allow\",\"target\":\"configure\",\"args\":{\"enabled\":0}}");
    join(&d, "Ben", PAL_WIRE_ROLE_TRAINEE, 0);
    CHECK(!order(&d, "study_point", "\"index\":1"));
    CHECK(strstr(trouble(&d), "only for instructors, and trainees with the right configure") != NULL);
    mem_end(&c);
    mem_end(&d);
    end();
}

/* who asks goes, and the server ends while it is being made */
static void a_server_that_ends_in_the_middle_ends(void)
{
    mem_client c;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    send(&c, "study_point", "\"index\":1");
    send(&c, "configure", "\"size\":12");
    served_serve(&c, NULL);
    mem_end(&c);
    served_serve(NULL, NULL);
    end();
}

int main(void)
{
    clay_make(&clay, 2, 0.1);
    configuration(0, "subdivision_fem", "", 1);
    configuration(1, "fem", "hex8_bbar", 8);
    configuration(2, "subdivision_fem", "", 2);
    RUN_SERIAL(two_clients_see_a_point_of_the_study);
    RUN(tools_stay_with_who_holds_them);
    RUN_SERIAL(a_pressure_is_transferred);
    RUN_SERIAL(a_handle_is_transferred);
    RUN(what_cannot_be_is_refused_with_a_sentence);
    RUN(a_server_that_ends_in_the_middle_ends);
    clay_free(&clay);
    return check_report();
}
