/* What one member may cost the others: commands after which a step is longer than its time, orders that slow a session,
 * jobs of one session and another, and accuracy that is given up before time. The clocks are the test's: a session is
 * slow when the time goes on by more than a step at once, and what anything takes of the processor is told here. */
#include "server/net/tuning.h"
#include "tests/net/command_room.h"
#include "tests/net/hub_scene.h"
#include "tests/session/sculpt_body.h"

static clay_scene clay;
#define TOP "\"x_m\":0.02,\"y_m\":0.02,\"z_m\":0.05"

#define YOUNG_PA 5000
/* a step or an evaluation of forces that is quick, and one of twice the time of the shortest steps here */
#define QUICK_NS 20000u
#define LONG_NS  200000u

/* what the processor's clock of a thread goes on by from one reading to the next: a step, or an evaluation of forces,
 * takes so long. A job takes it for each of its readings */
static _Atomic uint64_t work_ns;
uint64_t __wrap_pal_clock_thread_ns(void);
uint64_t __wrap_pal_clock_thread_ns(void)
{
    static _Thread_local uint64_t now_ns;
    return now_ns += work_ns;
}

static void begin(double step_s, double young, bool keep_real_time, uint64_t takes_ns)
{
    clay.scene.step_s = step_s;
    clay.scene.body[0].material.young_Pa = young;
    clay.scene.keep_real_time = keep_real_time;
    work_ns = takes_ns;
    order_begin(&clay.scene, NULL, 0);
}

/* the time goes on by n steps of the scene, of which the session makes one every `late` */
static void run(mem_client *a, mem_client *b, int n, int late)
{
    for (int i = 0; i < n; i += late) {
        manual_clock_advance(&served_clock, (uint64_t)late * served_step_ns);
        manual_clock_settle(&served_clock, 1);
        served_serve(a, b);
    }
}

/* the same while each step takes `late` of its time, on a machine that does nothing else */
static void run_slow(mem_client *a, mem_client *b, int n, int late)
{
    work_ns = (uint64_t)late * served_step_ns;
    run(a, b, n, late);
    work_ns = QUICK_NS;
}

static double young_Pa(void)
{
    pal_material m;
    pal_session_material(session, 0, &m);
    return m.young_Pa;
}

static void a_command_that_is_slower_than_real_time_is_refused(void)
{
    mem_client tim, ada;
    const double soft = YOUNG_PA;
    begin(1e-4, YOUNG_PA, false, QUICK_NS); /* a fifth of a step, but not of hundreds of sub-steps */
    join(&tim, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    join(&ada, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    run(&tim, &ada, 20, 1);
    const double stiff = 1e12;
    char args[64];
    snprintf(args, sizeof args, "\"young_Pa\":%g", stiff);
    send(&tim, "material", args);
    for (int i = 0; i < 100 && !tim.n_text[PAL_CONTROL_ERROR]; i++) run(&tim, &ada, 4000, 1);
    CHECK(strstr(trouble(&tim), "material: a step would take ") == trouble(&tim));
    CHECK(strstr(trouble(&tim), " ms of its 0.1 ms, with ") != NULL);
    CHECK_NEAR(young_Pa(), soft, 0);
    /* softer is never refused */
    const int before = tim.n_text[PAL_CONTROL_ERROR];
    snprintf(args, sizeof args, "\"young_Pa\":%g", soft / 2);
    send(&tim, "material", args);
    run(&tim, &ada, 100, 1);
    CHECK_NEAR(young_Pa(), soft / 2, 1e-9 * soft);
    CHECK_INT(tim.n_text[PAL_CONTROL_ERROR], before);
    mem_end(&tim), mem_end(&ada);
    end();
}

static void set_levels(int n)
{
    pal_config_entry *model = &clay.scene.body[0].model;
    for (int k = 0; k < model->n_value; k++)
        if (!strcmp(model->value[k].key, "levels")) model->value[k].number[0] = n;
}

static void so_is_a_configuration(void)
{
    mem_client tim, ada;
    begin(1e-4, 1e8, false, QUICK_NS);
    join(&tim, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    join(&ada, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    work_ns = LONG_NS; /* of what is finer */
    CHECK(!order(&tim, "configure", "\"size\":2"));
    CHECK(strstr(trouble(&tim), "configure: a step would take about ") == trouble(&tim));
    CHECK(strstr(trouble(&tim), "an instructor may order it") != NULL);
    CHECK_INT(tim.n_text[PAL_CONTROL_TOPOLOGY], 0);
    CHECK(order(&ada, "configure", "\"size\":2"));
    until_frame(&ada), until_frame(&tim);
    CHECK_INT(ada.n_text[PAL_CONTROL_TOPOLOGY], 1);
    /* the scene is slow now, as she has left it: what costs no more is allowed */
    CHECK(order(&tim, "configure", "\"size\":1"));
    mem_end(&tim), mem_end(&ada);
    end();
}

/* a step is compared with its own time, not with that of a longer one */
static void so_is_a_step_length(void)
{
    mem_client tim;
    begin(0.1, 10, false, LONG_NS);
    join(&tim, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    run(&tim, NULL, 10, 1);
    CHECK(!order(&tim, "configure", "\"step_ms\":0.1"));
    CHECK(strstr(trouble(&tim), "configure: a step would take about ") == trouble(&tim));
    CHECK_INT(tim.n_text[PAL_CONTROL_TOPOLOGY], 0);
    mem_end(&tim);
    end();
}

static void a_material_is_costed_before_the_first_step(void)
{
    mem_client tim;
    const double soft = YOUNG_PA;
    clay.scene.step_s = 1e-4, clay.scene.body[0].material.young_Pa = soft;
    work_ns = QUICK_NS;
    served_begin(&clay.scene, (pal_session_options){.start_paused = true}, (pal_server_options){0});
    join(&tim, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    send(&tim, "material", "\"young_Pa\":1e12");
    for (int i = 0; i < 100 && !tim.n_text[PAL_CONTROL_ERROR]; i++) run(&tim, NULL, 4000, 1);
    CHECK(strstr(trouble(&tim), "material: a step would take ") == trouble(&tim));
    CHECK_NEAR(young_Pa(), soft, 0);
    mem_end(&tim);
    end();
}

static void component(mem_client *c, const char *enabled)
{
    char text[200];
    snprintf(
        text, sizeof text,
        "{\"type\":\"command\",\"verb\":\"component\",\"target\":\"tet_volume\",\"args\":{\"part\":0,\"enabled\":%s}}",
        enabled);
    mem_text(c, text);
}

/* the status after everything that was sent has been done */
static bool is_disabled(mem_client *c, mem_client *other)
{
    run(c, other, 10000, 100);
    return c->last[PAL_CONTROL_STATUS].status.n_disabled > 0;
}

/* what was cheap while a component was disabled is not when it comes back */
static void so_is_a_component(void)
{
    static small_scene organ;
    mem_client tim, ada;
    REQUIRE(small_scene_make(&organ, "organ"));
    organ.scene.step_s = 1e-4;
    organ.scene.body[0].material.young_Pa = 1e10;
    work_ns = LONG_NS;
    order_begin(&organ.scene, NULL, 0);
    join(&tim, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    join(&ada, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    mem_text(&ada, "{\"type\":\"command\",\"verb\":\"allow\",\"target\":\"component\",\"args\":{}}");
    component(&ada, "0");
    CHECK(is_disabled(&ada, &tim));
    component(&tim, "1");
    CHECK(is_disabled(&ada, &tim));
    CHECK(strstr(trouble(&tim), "component: a step would take ") == trouble(&tim));
    component(&ada, "1");
    CHECK(!is_disabled(&ada, &tim));
    mem_end(&tim), mem_end(&ada);
    end();
    pal_prepared_free(&organ.mesh);
}

static void an_order_that_slows_the_session_is_taken_back(void)
{
    mem_client ada, eve;
    begin(0.01, YOUNG_PA, false, QUICK_NS);
    const double soft = YOUNG_PA;
    join(&ada, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    join(&eve, "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    run(&ada, &eve, 200, 1);
    send(&ada, "material", "\"young_Pa\":9000");
    run(&ada, &eve, 200, 1);
    CHECK_NEAR(young_Pa(), 9000, 0);
    /* slower, but by less than twice: it stays */
    for (int i = 0; i < 120; i++) run_slow(&ada, &eve, 3, 3), run(&ada, &eve, 2, 1);
    CHECK_INT(ada.n_text[PAL_CONTROL_ERROR], 0);
    /* so it does where it is not its steps that take the time, but other programs */
    send(&ada, "material", "\"young_Pa\":8000");
    run(&ada, &eve, 2000, 3);
    CHECK_INT(ada.n_text[PAL_CONTROL_ERROR], 0);
    CHECK_NEAR(young_Pa(), 8000, 0);
    send(&ada, "material", "\"young_Pa\":9000");
    run(&ada, &eve, 500, 1);
    send(&ada, "material", "\"young_Pa\":8000");
    run_slow(&ada, &eve, 250, 3);
    pal_reply reply;
    pal_mem_get(transport, "/readyz", &reply);
    CHECK_INT(reply.status, 503);
    CHECK(reply.body && !memcmp(reply.body->bytes, "a session runs 3.0 times slower than real time\n", 47));
    pal_packet_drop(reply.body);
    for (int i = 0; i < 400 && ada.n_text[PAL_CONTROL_ERROR] == 0; i++) run_slow(&ada, &eve, 3, 3);
    CHECK_TEXT(ada.last[PAL_CONTROL_ERROR].error.code, "undone");
    CHECK(strstr(trouble(&ada), "material by Ada was taken back: a step took 30 ms of its 10 ms") == trouble(&ada));
    CHECK_TEXT(trouble(&eve), trouble(&ada));
    run(&ada, &eve, 100, 1);
    CHECK_NEAR(young_Pa(), 9000, 0);
    CHECK(young_Pa() != soft);
    /* one that was given long before is not blamed */
    send(&ada, "material", "\"young_Pa\":7000");
    run(&ada, &eve, 1500, 1);
    run_slow(&ada, &eve, 900, 3);
    CHECK_INT(ada.n_text[PAL_CONTROL_ERROR], 1);
    CHECK_NEAR(young_Pa(), 7000, 0);
    mem_end(&ada), mem_end(&eve);
    end();
}

/* slow until somebody is told something more */
static void run_slowly(mem_client *a, mem_client *b)
{
    const int n = a->n_text[PAL_CONTROL_ERROR];
    for (int i = 0; i < 600 && a->n_text[PAL_CONTROL_ERROR] == n; i++) run_slow(a, b, 3, 3);
    CHECK_INT(a->n_text[PAL_CONTROL_ERROR], n + 1);
}

static void orders_after_it_do_not_hide_it(void)
{
    mem_client ada, tim;
    begin(0.01, YOUNG_PA, false, QUICK_NS);
    const double soft = YOUNG_PA;
    join(&ada, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    join(&tim, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    run(&ada, &tim, 200, 1);
    /* a slider is one order; what another orders then, and what is refused, are others */
    for (int i = 1; i < 5; i++) {
        char args[64];
        snprintf(args, sizeof args, "\"young_Pa\":%g", soft + i);
        send(&ada, "material", args);
        run(&ada, &tim, 50, 1);
    }
    send(&tim, "material", "\"damping_1_s\":3");
    run(&ada, &tim, 50, 1);
    send(&tim, "material", "\"young_Pa\":1e30");
    run(&ada, &tim, 50, 1);
    CHECK_NEAR(young_Pa(), soft + 4, 0);
    const int n = ada.n_text[PAL_CONTROL_ERROR];
    run_slowly(&ada, &tim);
    CHECK(strstr(trouble(&ada), "material by Tim was taken back") == trouble(&ada));
    CHECK_NEAR(young_Pa(), soft + 4, 0);
    run_slowly(&ada, &tim);
    CHECK(strstr(trouble(&ada), "material by Ada was taken back") == trouble(&ada));
    run_slow(&ada, &tim, 600, 3);
    CHECK_NEAR(young_Pa(), soft, 0);
    CHECK_INT(ada.n_text[PAL_CONTROL_ERROR], n + 2);
    mem_end(&ada), mem_end(&tim);
    end();
}

static void edits_and_what_undoes_them_are_taken_back(void)
{
    mem_client ada, eve;
    char asset[PAL_WIRE_NAME_BYTES];
    begin(0.01, YOUNG_PA, false, QUICK_NS);
    join(&ada, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    join(&eve, "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    run(&ada, &eve, 200, 1);
    snprintf(asset, sizeof asset, "%s", part(&ada)->asset);
    CHECK(order(&ada, "divide", TOP));
    CHECK(reported(&ada, "cells") > 8);
    until_frame(&ada);
    run_slowly(&ada, &eve);
    CHECK(strstr(trouble(&ada), "divide by Ada was taken back") == trouble(&ada));
    WAIT_UNTIL(ada.n_text[PAL_CONTROL_TOPOLOGY] == 2, &ada, &eve);
    CHECK_TEXT(part(&ada)->asset, asset); /* the cells as they were */
    until_frame(&ada);
    run(&ada, &eve, 1500, 1);
    CHECK(order(&ada, "divide", TOP));
    until_frame(&ada);
    snprintf(asset, sizeof asset, "%s", part(&ada)->asset);
    run(&ada, &eve, 1500, 1);
    CHECK(order(&ada, "undo", ""));
    until_frame(&ada);
    CHECK(strcmp(part(&ada)->asset, asset) != 0);
    run_slowly(&ada, &eve);
    CHECK(strstr(trouble(&ada), "undo by Ada was taken back") == trouble(&ada));
    WAIT_UNTIL(ada.n_text[PAL_CONTROL_TOPOLOGY] == 5, &ada, &eve);
    CHECK_TEXT(part(&ada)->asset, asset); /* divided */
    mem_end(&ada), mem_end(&eve);
    end();
}

static void accuracy_is_given_up_before_time_and_comes_back(void)
{
    mem_client eve;
    begin(0.1, 10, true, QUICK_NS);
    join(&eve, "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    run(&eve, NULL, 100, 1);
    run(&eve, NULL, 200, 1); /* in time: nothing happens */
    CHECK_INT(eve.n_text[PAL_CONTROL_ERROR], 0);
    char asset[PAL_WIRE_NAME_BYTES];
    snprintf(asset, sizeof asset, "%s", part(&eve)->asset);
    for (int i = 0; i < 400 && !eve.n_text[PAL_CONTROL_ERROR]; i++) run(&eve, NULL, 3, 3);
    CHECK_TEXT(eve.last[PAL_CONTROL_ERROR].error.code, "quality");
    CHECK(strstr(trouble(&eve), "3.0 times slower than real time: going on with ") == trouble(&eve));
    WAIT_UNTIL(eve.n_text[PAL_CONTROL_TOPOLOGY] == 1, &eve, NULL);
    until_frame(&eve);
    CHECK(strstr(trouble(&eve), "1 level") != NULL);
    CHECK(strcmp(part(&eve)->asset, asset) != 0);
    /* in time again, with time to spare: after 20 s as before */
    run(&eve, NULL, (int)(PAL_QUALITY_SPARE_NS / served_step_ns) - 40, 1);
    CHECK_INT(eve.n_text[PAL_CONTROL_ERROR], 1);
    for (int i = 0; i < 2000 && eve.n_text[PAL_CONTROL_ERROR] < 2; i++) run(&eve, NULL, 1, 1);
    REQUIRE(strstr(trouble(&eve), "there is time to spare: back to ") == trouble(&eve));
    WAIT_UNTIL(eve.n_text[PAL_CONTROL_TOPOLOGY] == 2, &eve, NULL);
    until_frame(&eve);
    CHECK_TEXT(part(&eve)->asset, asset);
    mem_end(&eve);
    end();
}

/* the next cheaper point of the study's Pareto front; each fall makes the next rise later */
static void a_study_says_what_is_cheaper(void)
{
    pal_measured_configuration point[4] = {0};
    static const double ms[4] = {1, 2, 3, 4};
    mem_client eve;
    for (int i = 0; i < 4; i++) {
        order_point(&point[i], "subdivision_fem", "", i < 3 ? 1 : 2);
        point[i].ms = ms[i], point[i].error_m = 0.01 / ms[i];
    }
    point[0].configuration.step_s = 0.05;
    point[1].configuration.step_s = 0.1;
    point[2].configuration.step_s = 0.08, point[2].front = false;
    clay.scene.step_s = 0.1, clay.scene.body[0].material.young_Pa = 10, clay.scene.keep_real_time = true;
    work_ns = QUICK_NS;
    order_begin(&clay.scene, point, 4);
    join(&eve, "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    run(&eve, NULL, 100, 1);
    for (int k = 0; k < 2; k++) {
        const int n = eve.n_text[PAL_CONTROL_ERROR], n_topology = eve.n_text[PAL_CONTROL_TOPOLOGY];
        run_slowly(&eve, NULL);
        CHECK(strstr(trouble(&eve), "going on with subdivision_fem, 1 level, 100 ms") != NULL);
        WAIT_UNTIL(eve.n_text[PAL_CONTROL_TOPOLOGY] == n_topology + 1, &eve, NULL);
        until_frame(&eve);
        run(&eve, NULL, (int)((PAL_QUALITY_SPARE_NS << k) / served_step_ns) - 40, 1);
        CHECK_INT(eve.n_text[PAL_CONTROL_ERROR], n + 1);
        for (int i = 0; i < 500 && eve.n_text[PAL_CONTROL_ERROR] < n + 2; i++) run(&eve, NULL, 1, 1);
        REQUIRE(strstr(trouble(&eve), "back to subdivision_fem, 2 levels") != NULL);
        WAIT_UNTIL(eve.n_text[PAL_CONTROL_TOPOLOGY] == n_topology + 2, &eve, NULL);
        until_frame(&eve);
    }
    mem_end(&eve);
    end();
}

/* a trainee's jobs may take half of the time; an instructor's are not counted */
static void a_member_waits_for_the_time_of_its_jobs(void)
{
    mem_client tim, ada;
    begin(0.1, 10, false, 50000000); /* for each of some ten readings by a job: s together, but no more than 100 s */
    join(&tim, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    join(&ada, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    static const char *const to[] = {"\"size\":1", "\"size\":2"};
    int n = 0;
    while (n < 200 && order(&tim, "configure", to[n % 2])) {
        until_frame(&ada), until_frame(&tim);
        n++;
    }
    CHECK(n >= 1);
    CHECK_TEXT(tim.last[PAL_CONTROL_ERROR].error.code, "busy");
    CHECK(strstr(trouble(&tim), "configure: your commands have taken much time: wait ") == trouble(&tim));
    CHECK(order(&ada, "configure", to[n % 2]));
    until_frame(&ada), until_frame(&tim);
    run(&tim, &ada, 1000, 100); /* 100 s */
    CHECK(order(&tim, "configure", to[(n + 1) % 2]));
    mem_end(&tim), mem_end(&ada);
    end();
}

/* one session's commands wait in its own queue, on its own thread */
static void commands_of_one_session_do_not_wait_for_anothers(void)
{
    static pal_scene scene;
    static mem_client ada, bo;
    pal_session *two[2] = {NULL, NULL};
    pal_diagnostic diag = {""};
    pal_server_options net = {.transport = &pal_mem_transport, .open = true};
    clay.scene.step_s = 0.02, clay.scene.keep_real_time = false;
    scene = clay.scene;
    snprintf(scene.name, sizeof scene.name, "second");
    work_ns = QUICK_NS;
    served_session(&clay.scene, (pal_session_options){0});
    two[0] = session;
    const pal_session_options options = {
        .clock = &served_clock.clock, .lease_s = 60, .wake = pal_server_gate_wake, .user = &gate};
    REQUIRE(!pal_session_open(&scene, &options, &diag, &two[1]));
    REQUIRE(!pal_server_open(&net, two, 2, &diag, &server));
    pal_server_connect(server, &gate);
    transport = pal_server_transport(server);
    join(&ada, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    memset(&bo, 0, sizeof bo);
    bo.transport = transport, bo.peer = pal_mem_connect_from(transport, "second", "", "");
    mem_enter(&bo, "Bo", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE, false);
    mem_pull(&bo, 1000);
    until_frame(&bo);
    for (int i = 0; i < 7; i++) send(&ada, i % 2 ? "undo" : "extrude", i % 2 ? "" : TOP ",\"distance_m\":0.02");
    mem_pull(&ada, 1000);
    CHECK_TEXT(ada.last[PAL_CONTROL_ERROR].error.code, "busy"); /* of those two find no place */
    send(&bo, "extrude", TOP ",\"distance_m\":0.02");
    WAIT_UNTIL(n_answer(&bo) == 1, &ada, &bo);
    CHECK_INT(bo.n_text[PAL_CONTROL_ANSWER], 1);
    WAIT_UNTIL(n_answer(&ada) >= 7, &ada, &bo);
    mem_end(&ada), mem_end(&bo);
    pal_server_close(server);
    for (int i = 0; i < 2; i++) pal_session_close(two[i]);
}

int main(void)
{
    clay_make(&clay, 2, 0.1);
    RUN(a_command_that_is_slower_than_real_time_is_refused);
    RUN_SERIAL(so_is_a_configuration);
    RUN_SERIAL(so_is_a_step_length);
    RUN(a_material_is_costed_before_the_first_step);
    RUN_SERIAL(so_is_a_component);
    RUN(an_order_that_slows_the_session_is_taken_back);
    RUN_SERIAL(orders_after_it_do_not_hide_it);
    RUN_SERIAL(edits_and_what_undoes_them_are_taken_back);
    set_levels(2);
    RUN(commands_of_one_session_do_not_wait_for_anothers);
    RUN(accuracy_is_given_up_before_time_and_comes_back);
    RUN_SERIAL(a_study_says_what_is_cheaper);
    RUN_LONG(a_member_waits_for_the_time_of_its_jobs);
    clay_free(&clay);
    return check_report();
}
