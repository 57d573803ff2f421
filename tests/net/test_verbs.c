/* The table of verbs: a command is one line and one function. */
#include "server/net/hub_peers.h"
#include "server/net/hub_verb.h"
#include "tests/net/hub_scene.h"
#include "tests/net/server_fixture.h"

static int n_run;

static bool run_whistle(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    n_run++;
    pal_wire_answer *a = pal_hub_answer_begin(c, verb->name);
    pal_hub_answer_arg(a, "pitch_Hz", 2 * pal_hub_arg(command, "pitch_Hz", 0) + verb->detail);
    pal_hub_send(c);
    return true;
}

static const pal_verb own[] = {
    {"whistle", "pitch_Hz | loud", PAL_RIGHT_TRAINEE, run_whistle, 1, "answer an octave higher and a hertz"}};

static void a_verb_of_ones_own_table_is_checked_and_run(void)
{
    static mem_client ada, bo;
    small_scene fixture;
    REQUIRE(small_scene_make(&fixture, "small"));
    n_run = 0;
    served_begin(&fixture.scene, (pal_session_options){.start_paused = true},
                 (pal_server_options){.verb = own, .n_verb = 1});
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    mem_join(&bo, transport, "Bo", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_text(&ada, "{\"type\":\"command\",\"verb\":\"whistle\",\"args\":{\"pitch_Hz\":440}}");
    mem_text(&bo, "{\"type\":\"command\",\"verb\":\"whistle\",\"args\":{\"pitch_Hz\":440}}");
    mem_pull(&ada, 100), mem_pull(&bo, 100);
    CHECK_INT(n_run, 1);
    CHECK_NEAR(ada.last[PAL_CONTROL_ANSWER].answer.arg[0].value, 881, 0);
    CHECK_TEXT(bo.last[PAL_CONTROL_ERROR].error.code, "role");
    mem_text(&ada, "{\"type\":\"command\",\"verb\":\"whistle\",\"args\":{\"loud\":1}}");
    mem_pull(&ada, 100);
    CHECK_TEXT(ada.last[PAL_CONTROL_ERROR].error.text, "whistle: pitch_Hz is missing");
    mem_text(&ada, "{\"type\":\"command\",\"verb\":\"pause\"}");
    mem_pull(&ada, 100);
    CHECK_TEXT(ada.last[PAL_CONTROL_ERROR].error.code, "verb");
    mem_end(&ada), mem_end(&bo);
    end();
    pal_prepared_free(&fixture.mesh);
}

static void the_description_names_each_verb_once(void)
{
    char text[8192];
    CHECK_INT(pal_verb_describe(own, 1, text, sizeof text), (int)strlen(text));
    CHECK_TEXT(text, "whistle\ttrainees and instructors\tpitch_Hz | loud\tanswer an octave higher and a hertz\n");
    int n = pal_verb_describe(pal_verb_table, pal_verb_count, text, sizeof text), n_line = 0;
    REQUIRE(n < (int)sizeof text);
    for (int i = 0; i < n; i++) n_line += text[i] == '\n';
    CHECK_INT(n_line, pal_verb_count);
    for (int i = 0; i < pal_verb_count; i++)
        for (int k = 0; k < i; k++) CHECK(strcmp(pal_verb_table[i].name, pal_verb_table[k].name) != 0);
    CHECK_INT(pal_verb_describe(pal_verb_table, pal_verb_count, text, 10), n); /* as snprintf: never past its room */
}

int main(void)
{
    RUN(a_verb_of_ones_own_table_is_checked_and_run);
    RUN(the_description_names_each_verb_once);
    return check_report();
}
