/* Nobody looks at a world: what is shown is not computed, motion and hash are the same to the bit, tools touch what is
 * there, and the first look shows the present. */
#include "tests/fixtures/model_scenes.h"

static uint64_t outputs(const model_scene *m)
{
    return m->body->display.n_output;
}

/* steps at rest, then with tools, then without */
static void nobody_looks_and_all_moves_the_same(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) {
        model_scene seen, unseen;
        model_scene_make(&seen, (model_kind)k), model_scene_make(&unseen, (model_kind)k);
        model_scene_defaults(&seen), model_scene_defaults(&unseen);
        REQUIRE(model_scene_open(&seen) && model_scene_open(&unseen));
        pal_world_watch(unseen.world, false);
        CHECK(model_scene_steps(&seen, 20) && model_scene_steps(&unseen, 20));
        CHECK_INT(outputs(&seen), 21);
        CHECK_INT(outputs(&unseen), 1);
        CHECK_INT(pal_world_component(unseen.world, model_scene_row(&unseen, "surface_output"))->n_run, 1);
        /* tools touch what is shown: there it is needed */
        CHECK(model_scene_touch(&seen, 0, 25) && model_scene_touch(&unseen, 0, 25));
        CHECK(outputs(&unseen) > 20 && outputs(&unseen) < 27);
        CHECK(pal_world_hash(seen.world) == pal_world_hash(unseen.world));
        for (int t = 0; t < 2; t++) {
            const pal_tool *a = &pal_world_tools(seen.world)->tool[t], *b = &pal_world_tools(unseen.world)->tool[t];
            CHECK(!memcmp(a, b, sizeof *a));
            pal_world_pose(seen.world, t, NULL), pal_world_pose(unseen.world, t, NULL);
        }
        CHECK(model_scene_steps(&seen, 40) && model_scene_steps(&unseen, 40));
        CHECK(outputs(&unseen) < 40);
        CHECK(pal_world_hash(seen.world) == pal_world_hash(unseen.world));
        size_t n_byte = 3 * sizeof(float) * (size_t)seen.body->display.n_shown;
        CHECK(memcmp(seen.body->display.shown, unseen.body->display.shown, n_byte) != 0);
        pal_world_watch(unseen.world, true);
        CHECK(!memcmp(seen.body->display.shown, unseen.body->display.shown, n_byte));
        printf("  %s: shown %d times unseen, %d seen\n", model_kind_name[k], (int)outputs(&unseen),
               (int)outputs(&seen));
        model_scene_close(&seen), model_scene_close(&unseen);
    }
}

/* frames that somebody takes nevertheless: old positions, said so */
static void frames_of_a_world_unseen_say_so(void)
{
    model_scene m;
    model_scene_make(&m, SPRINGS);
    model_scene_defaults(&m);
    REQUIRE(model_scene_open(&m));
    pal_frame *frame = pal_frame_create(m.world), *other = pal_frame_create(m.world);
    REQUIRE(frame && other);
    pal_world_frame(m.world, frame);
    CHECK(frame->watched && frame->part[0].n_output == 1);
    float *rest = malloc(3 * sizeof(float) * (size_t)frame->part[0].n_vertex);
    REQUIRE(rest);
    memcpy(rest, frame->part[0].position_m, 3 * sizeof(float) * (size_t)frame->part[0].n_vertex);
    pal_world_watch(m.world, false);
    CHECK(model_scene_steps(&m, 10));
    pal_world_frame(m.world, frame), pal_world_frame(m.world, other);
    CHECK(!frame->watched && frame->part[0].n_output == 1 && frame->tick == 10);
    size_t n_byte = 3 * sizeof(float) * (size_t)frame->part[0].n_vertex;
    CHECK(!memcmp(rest, frame->part[0].position_m, n_byte));
    CHECK(!memcmp(rest, other->part[0].position_m, n_byte));
    pal_world_watch(m.world, true);
    pal_world_frame(m.world, frame);
    CHECK(frame->watched && frame->part[0].n_output == 2);
    CHECK(memcmp(rest, frame->part[0].position_m, n_byte) != 0);
    free(rest);
    pal_frame_destroy(frame), pal_frame_destroy(other);
    model_scene_close(&m);
}

static void sleeps_unseen_and_wakes_for_tools(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) {
        uint64_t hash[2];
        for (int unseen = 0; unseen < 2; unseen++) {
            model_scene m;
            model_scene_make(&m, (model_kind)k);
            model_scene_defaults(&m);
            model_scene_effect(&m, "sleep");
            m.def->material.damping_1_s = 12;
            REQUIRE(model_scene_open(&m));
            pal_world_watch(m.world, !unseen);
            for (int i = 0; i < 1200 && !m.body->asleep; i++) REQUIRE(model_scene_steps(&m, 1));
            CHECK(m.body->asleep);
            if (unseen) CHECK_INT(outputs(&m), 2);
            CHECK(model_scene_steps(&m, 30));
            CHECK(model_scene_touch(&m, 0, 25));
            CHECK(!m.body->asleep);
            hash[unseen] = pal_world_hash(m.world);
            model_scene_close(&m);
        }
        CHECK(hash[0] == hash[1]);
    }
}

int main(void)
{
    RUN(nobody_looks_and_all_moves_the_same);
    RUN(frames_of_a_world_unseen_say_so);
    RUN(sleeps_unseen_and_wakes_for_tools);
    return check_report();
}
