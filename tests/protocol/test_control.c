/* Control messages: limits, fields, hostile text. That both directions agree is in test_golden_packets.c. */
#include "protocol/control.h"
#include "tests/check.h"
#include "tests/protocol/golden.h"

static pal_control c;

static int from_client(const char *text)
{
    return pal_control_get(text, strlen(text), false, &c);
}

static void reads_what_a_client_says(void)
{
    CHECK_INT(from_client("{\"type\":\"join\",\"name\":\"A\\u00e9\",\"role\":\"trainee\",\"tool\":-1}"), 0);
    CHECK_INT(c.type, PAL_CONTROL_JOIN);
    CHECK_TEXT(c.join.name, "A\xC3\xA9");
    CHECK_INT(c.join.role, PAL_WIRE_ROLE_TRAINEE);
    CHECK_INT(c.join.tool, PAL_WIRE_TOOL_ANY);
    CHECK_INT(from_client(" {\"role\":\"viewer\",\"later\":[1,{}],\"type\":\"join\",\"name\":\"\",\"tool\":null}\n"),
              0);
    CHECK_INT(c.join.tool, PAL_WIRE_TOOL_NONE);
    CHECK_INT(from_client("{\"type\":\"join\",\"name\":\"B\",\"role\":\"viewer\"}"), 0);
    CHECK_INT(c.join.tool, PAL_WIRE_TOOL_NONE);
    CHECK(!c.join.topology_deltas);
    CHECK_INT(from_client("{\"type\":\"join\",\"name\":\"B\",\"role\":\"viewer\",\"topology_deltas\":true}"), 0);
    CHECK(c.join.topology_deltas);
    CHECK_INT(from_client("{\"type\":\"command\",\"verb\":\"pause\"}"), 0);
    CHECK_TEXT(c.command.verb, "pause");
    CHECK_INT(c.command.n_arg, 0);
    CHECK_INT(from_client("{\"type\":\"command\",\"verb\":\"material\",\"args\":{\"young_Pa\":8e3,\"poisson\":0.45}}"),
              0);
    CHECK_INT(c.command.n_arg, 2);
    CHECK_TEXT(c.command.arg[0].key, "young_Pa");
    CHECK_NEAR(c.command.arg[0].value, 8000, 0);
    CHECK_INT(from_client("{\"type\":\"take_tool\",\"tool\":3}"), 0);
    CHECK_INT(c.tool, 3);
    CHECK_INT(from_client("{\"type\":\"release_tool\"}"), 0);
    CHECK_INT(from_client("{\"type\":\"ping\",\"stamp_ms\":-1.5}"), 0);
    CHECK_NEAR(c.stamp_ms, -1.5, 0);
    CHECK_INT(from_client("{\"type\":\"subscribe_field\",\"part\":2,\"field\":\"energy\",\"later\":1}"), 0);
    CHECK_INT(c.field_subscription.part, 2);
    CHECK_TEXT(c.field_subscription.field, "energy");
}

static void refuses_what_is_no_message(void)
{
    static const struct {
        const char *text;
        int refusal;
    } bad[] = {
        {"", PAL_REFUSAL_JSON},
        {"{", PAL_REFUSAL_JSON},
        {"null", PAL_REFUSAL_FIELD},
        {"[]", PAL_REFUSAL_FIELD},
        {"{}", PAL_REFUSAL_FIELD},
        {"{\"type\":1}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"unknown\"}", PAL_REFUSAL_KIND},
        {"{\"type\":\"hello\"}", PAL_REFUSAL_KIND},
        {"{\"type\":\"release_tool\"}{}", PAL_REFUSAL_JSON},
        {"{\"type\":\"release_tool\"} x", PAL_REFUSAL_JSON},
        {"{\"type\":\"join\"}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"join\",\"name\":3,\"role\":\"viewer\"}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"join\",\"name\":\"x\",\"role\":\"boss\"}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"join\",\"name\":\"a\\nb\",\"role\":\"viewer\"}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"join\",\"name\":\"0123456789012345678901234567890x\",\"role\":\"viewer\"}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"join\",\"name\":\"\xC3\",\"role\":\"viewer\"}", PAL_REFUSAL_JSON},
        {"{\"type\":\"join\",\"name\":\"\xED\xA0\x80\",\"role\":\"viewer\"}", PAL_REFUSAL_JSON},
        {"{\"type\":\"join\",\"name\":\"\xC0\xAF\",\"role\":\"viewer\"}", PAL_REFUSAL_JSON},
        {"{\"type\":\"join\",\"name\":\"x\",\"role\":\"viewer\",\"topology_deltas\":1}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"take_tool\"}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"take_tool\",\"tool\":null}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"take_tool\",\"tool\":32}", PAL_REFUSAL_RANGE},
        {"{\"type\":\"take_tool\",\"tool\":0.5}", PAL_REFUSAL_RANGE},
        {"{\"type\":\"take_tool\",\"tool\":-2}", PAL_REFUSAL_RANGE},
        {"{\"type\":\"take_tool\",\"tool\":1e400}", PAL_REFUSAL_NAN},
        {"{\"type\":\"ping\",\"stamp_ms\":1e999}", PAL_REFUSAL_NAN},
        {"{\"type\":\"ping\",\"stamp_ms\":\"1\"}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"subscribe_field\",\"field\":\"energy\"}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"subscribe_field\",\"part\":0}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"subscribe_field\",\"part\":-1,\"field\":\"none\"}", PAL_REFUSAL_RANGE},
        {"{\"type\":\"subscribe_field\",\"part\":0,\"field\":3}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"a name that is longer than "
         "all the names of fields one after the other, each with the space that stands between two of them\"}",
         PAL_REFUSAL_FIELD},
        {"{\"type\":\"command\",\"verb\":\"x\",\"args\":[1]}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"command\",\"verb\":\"x\",\"args\":{\"a\":\"b\"}}", PAL_REFUSAL_FIELD},
        {"{\"type\":\"command\",\"verb\":\"x\",\"args\":{\"a\":1,\"b\":1,\"c\":1,\"d\":1,\"e\":1,\"f\":1,\"g\":1,"
         "\"h\":1,\"i\":1,\"j\":1,\"k\":1,\"l\":1,\"m\":1,\"n\":1,\"o\":1,\"p\":1,\"q\":1}}",
         PAL_REFUSAL_COUNT}};
    c.type = PAL_CONTROL_COUNT;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        int refusal = from_client(bad[i].text);
        if (refusal != bad[i].refusal) printf("  %s\n", bad[i].text);
        CHECK_INT(refusal, bad[i].refusal);
    }
    CHECK_INT(c.type, PAL_CONTROL_COUNT); /* out is untouched by refusals */
    CHECK_INT(pal_control_get("{\"type\":\"release_tool\"\0}", 24, false, &c), PAL_REFUSAL_JSON);
}

static void refuses_text_beyond_the_limits_before_parsing_it(void)
{
    static char text[PAL_CONTROL_OUT_MAX + 2];
    memset(text, ' ', sizeof text);
    memcpy(text, "{\"type\":\"release_tool\"}", 23);
    CHECK_INT(pal_control_get(text, PAL_CONTROL_IN_MAX, false, &c), 0);
    CHECK_INT(pal_control_get(text, PAL_CONTROL_IN_MAX + 1, false, &c), PAL_REFUSAL_LONG);
    CHECK_INT(pal_control_get(text, PAL_CONTROL_OUT_MAX + 1, true, &c), PAL_REFUSAL_LONG);
    /* nesting and number of values */
    memset(text, '[', 4096);
    CHECK_INT(pal_control_get(text, 4096, false, &c), PAL_REFUSAL_JSON);
    for (int depth = 1; depth < 12; depth++) {
        char deep[64] = "{\"type\":\"release_tool\",\"x\":";
        size_t n = strlen(deep);
        for (int k = 0; k < depth; k++) deep[n++] = '[';
        for (int k = 0; k < depth; k++) deep[n++] = ']';
        deep[n++] = '}';
        CHECK_INT(pal_control_get(deep, n, false, &c), depth <= 7 ? PAL_REFUSAL_NONE : PAL_REFUSAL_JSON);
    }
    size_t n = (size_t)snprintf(text, sizeof text, "{\"type\":\"release_tool\",\"x\":[0");
    for (int k = 0; k < 1000; k++) n += (size_t)snprintf(text + n, sizeof text - n, ",0");
    n += (size_t)snprintf(text + n, sizeof text - n, "]}");
    CHECK_INT(pal_control_get(text, n, false, &c), PAL_REFUSAL_JSON);
}

/* what servers and clients of before wrote: parts without fields, no accuracy, status without rows */
static void reads_messages_of_before_fields(void)
{
    static const char hello[] =
        "{\"type\":\"hello\",\"version\":1,\"session\":\"main\",\"title\":\"\",\"organ\":\"\",\"step_rate_hz\":60,"
        "\"frame_rate_hz\":60,\"credit\":3,\"box_min_m\":[0,0,0],\"box_max_m\":[1,1,1],\"up\":[0,0,1],\"parts\":[{"
        "\"name\":\"liver\",\"epoch\":1,\"n_vertex\":4,\"n_triangle\":4,\"asset\":\"/asset/0\",\"error_m\":5e-5}],"
        "\"tools\":[],\"components\":[],\"you\":{\"id\":1,\"role\":\"viewer\",\"name\":\"A\",\"tool\":null}}";
    static const char status[] =
        "{\"type\":\"status\",\"tick\":1,\"sim_time_s\":0,\"paused\":false,\"frozen\":false,\"step_rate_hz\":60,"
        "\"slowdown\":1,\"substeps\":1,\"step_ms\":1,\"component_ms\":[1],\"members\":1,\"bytes_s\":0,\"rtt_ms\":0,"
        "\"skipped_cycles\":0,\"late_steps\":0,\"refused_inputs\":0}";
    CHECK_INT(pal_control_get(hello, sizeof hello - 1, true, &c), 0);
    CHECK_INT(c.hello.part[0].n_field, 0);
    CHECK(!c.hello.part[0].is_adaptive);
    CHECK_TEXT(c.hello.accuracy, "");
    CHECK_INT(pal_control_get(status, sizeof status - 1, true, &c), 0);
    CHECK_INT(c.status.n_component_name, 0);
    CHECK_INT(c.status.n_active, 0);
    CHECK_INT(c.status.n_state, 0);
    CHECK_INT(c.status.n_disabled, 0);
    CHECK_INT(c.status.n_component_part, 0);
    CHECK(c.status.n_unobserved == 0);
    static const char topology[] = "{\"type\":\"topology\",\"parts\":[]}";
    CHECK_INT(pal_control_get(topology, sizeof topology - 1, true, &c), 0);
    CHECK_INT(c.topology.plan.n_component, 0);
}

/* a number that nobody knows is NaN here and not there on the wire; what is required is never left out */
static void what_is_not_known_is_not_written(void)
{
    static char text[PAL_CONTROL_OUT_MAX + 1];
    static pal_control estimate;
    size_t n;
    golden_control(PAL_CONTROL_ESTIMATE, &estimate);
    REQUIRE(pal_control_put(text, sizeof text, &estimate, &n) == 0);
    CHECK(!strstr(text, "error_m") && !strstr(text, "nan") && strstr(text, "\"estimate_ms\":0"));
    REQUIRE(pal_control_get(text, n, true, &c) == 0);
    CHECK(isnan(c.estimate.error_m) && isnan(c.estimate.model_m) && isnan(c.estimate.study_point));
    estimate.estimate.estimate_ms = NAN;
    CHECK_INT(pal_control_put(text, sizeof text, &estimate, &n), PAL_REFUSAL_NAN);
    estimate.estimate.estimate_ms = 0;
    estimate.estimate.error_m = INFINITY;
    CHECK_INT(pal_control_put(text, sizeof text, &estimate, &n), PAL_REFUSAL_NAN);
    estimate.estimate.error_m = 0; /* known to be none: another thing than not known */
    REQUIRE(pal_control_put(text, sizeof text, &estimate, &n) == 0);
    CHECK(strstr(text, "\"error_m\":0"));
    static const char bad[] =
        "{\"type\":\"study\",\"body\":\"a\",\"step_ms\":1,\"points\":[{\"index\":0,\"method\":\"fem\",\"label\":\"\","
        "\"cost_ms\":1}]}";
    CHECK_INT(pal_control_get(bad, sizeof bad - 1, true, &c), PAL_REFUSAL_FIELD);
}

/* an empty text is as good as none, and is not written */
static void accuracy_is_said_only_where_there_is_one(void)
{
    static char text[PAL_CONTROL_OUT_MAX + 1], other[PAL_CONTROL_OUT_MAX + 1];
    static pal_control hello;
    size_t n;
    golden_control(PAL_CONTROL_HELLO, &hello);
    REQUIRE(pal_control_put(text, sizeof text, &hello, &n) == 0);
    CHECK(!strstr(text, "accuracy"));
    golden_accuracy(&hello.hello);
    REQUIRE(pal_control_put(text, sizeof text, &hello, &n) == 0);
    char *at = strstr(text, "\"organ\":"), *summary = strstr(text, ",\"accuracy\":\"2.1 % RMS of finite elements");
    CHECK(at && summary && summary > at && strstr(summary, ",\"step_rate_hz\":500"));
    REQUIRE(pal_control_get(text, n, true, &c) == 0);
    CHECK_TEXT(c.hello.accuracy, hello.hello.accuracy);
    /* a number is no text */
    REQUIRE(summary);
    n = (size_t)snprintf(other, sizeof other, "%.*s,\"accuracy\":7%s", (int)(summary - text), text,
                         strstr(summary, ",\"step_rate_hz\""));
    CHECK_INT(pal_control_get(other, n, true, &c), PAL_REFUSAL_FIELD);
    memset(hello.hello.accuracy, 7, 3);
    CHECK(pal_control_put(text, sizeof text, &hello, &n) != 0);
}

static void refuses_every_prefix(void)
{
    static char text[PAL_CONTROL_OUT_MAX + 1];
    for (int type = 0; type < PAL_CONTROL_COUNT; type++) {
        size_t n;
        static pal_control golden;
        golden_control((pal_control_type)type, &golden);
        REQUIRE(pal_control_put(text, sizeof text, &golden, &n) == 0);
        for (size_t cut = 0; cut < n; cut++) {
            char *exact = malloc(cut + 1);
            memcpy(exact, text, cut);
            CHECK_INT(pal_control_get(exact, cut, type < PAL_CONTROL_JOIN, &c), PAL_REFUSAL_JSON);
            free(exact);
        }
    }
}

static void largest_messages_fit_their_limit(void)
{
    static char text[PAL_CONTROL_OUT_MAX + 1];
    static pal_control full, again;
    size_t n;
    full.type = PAL_CONTROL_MEMBERS;
    full.members.n_member = PAL_WIRE_MEMBER_MAX;
    for (int i = 0; i < PAL_WIRE_MEMBER_MAX; i++) {
        pal_wire_member *m = &full.members.member[i];
        *m = (pal_wire_member){65535, PAL_WIRE_ROLE_INSTRUCTOR, 31, 0xFFFFFF, "", "", true};
        memset(m->rights, '"', sizeof m->rights - 1);
        memset(m->name, '"', sizeof m->name - 1);
    }
    CHECK_INT(pal_control_put(text, sizeof text, &full, &n), 0);
    CHECK_INT(pal_control_get(text, n, true, &again), 0);
    CHECK_INT(again.members.n_member, PAL_WIRE_MEMBER_MAX);

    memset(&full, 0, sizeof full);
    full.type = PAL_CONTROL_HELLO;
    golden_hello(&full.hello);
    memset(full.hello.accuracy, '"', PAL_WIRE_TEXT_BYTES - 1);
    full.hello.n_part = PAL_WIRE_PART_MAX;
    full.hello.n_tool = PAL_WIRE_TOOL_MAX;
    full.hello.plan.n_component = PAL_WIRE_COMPONENT_MAX;
    golden_parts(full.hello.part, PAL_WIRE_PART_MAX);
    for (int i = 0; i < PAL_WIRE_COMPONENT_MAX; i++) memset(full.hello.plan.component[i], 'r', PAL_WIRE_NAME_BYTES - 1);
    full.hello.plan.n_part = full.hello.plan.n_reason = full.hello.plan.n_required = PAL_WIRE_COMPONENT_MAX;
    for (int i = 0; i < PAL_WIRE_COMPONENT_MAX; i++) memset(full.hello.plan.reason[i], '"', PAL_WIRE_REASON_BYTES - 1);
    for (int i = 0; i < PAL_WIRE_TOOL_MAX; i++) memset(full.hello.tool[i].name, '\\', PAL_WIRE_NAME_BYTES - 1);
    CHECK_INT(pal_control_put(text, sizeof text, &full, &n), 0);
    CHECK_INT(pal_control_get(text, n, true, &again), 0);
    CHECK_INT(again.hello.plan.n_component, PAL_WIRE_COMPONENT_MAX);
    CHECK_TEXT(again.hello.tool[31].name, full.hello.tool[31].name);

    memset(&full, 0, sizeof full);
    golden_control(PAL_CONTROL_STATUS, &full);
    full.status.n_active = PAL_WIRE_PART_MAX;
    for (uint32_t i = 0; i < PAL_WIRE_PART_MAX; i++)
        full.status.active[i] = (pal_wire_active){i, UINT32_MAX, UINT32_MAX, UINT32_MAX, UINT32_MAX};
    full.status.n_component = full.status.n_component_name = PAL_WIRE_COMPONENT_MAX;
    for (int i = 0; i < PAL_WIRE_COMPONENT_MAX; i++) {
        full.status.component_ms[i] = 1 / 3.0;
        memset(full.status.component[i], '"', PAL_WIRE_NAME_BYTES - 1);
        memset(full.status.disabled[i].component, '"', PAL_WIRE_NAME_BYTES - 1);
        full.status.component_part[i] = -1;
    }
    full.status.n_component_part = full.status.n_disabled = PAL_WIRE_COMPONENT_MAX;
    full.status.n_state = PAL_WIRE_PART_MAX;
    for (uint32_t i = 0; i < PAL_WIRE_PART_MAX; i++) {
        full.status.state[i] = (pal_wire_part_state){i, true, true, "", 9007199254740991, 1 / 3.0};
        memset(full.status.state[i].reason, '"', PAL_WIRE_REASON_BYTES - 1);
    }
    CHECK_INT(pal_control_put(text, sizeof text, &full, &n), 0);
    CHECK_INT(pal_control_get(text, n, true, &again), 0);
    CHECK(again.status.n_active == PAL_WIRE_PART_MAX && again.status.active[15].n_finest_spring == UINT32_MAX);
    CHECK(again.status.n_state == PAL_WIRE_PART_MAX && again.status.state[15].n_safeguard == 9007199254740991);
}

static void the_largest_study_fits_its_limit(void)
{
    static char text[PAL_CONTROL_OUT_MAX + 1];
    static pal_control full, again;
    size_t n;
    full.type = PAL_CONTROL_STUDY;
    full.study.n_point = PAL_WIRE_POINT_MAX, full.study.reference_m = 1e-7 / 3;
    for (uint32_t i = 0; i < PAL_WIRE_POINT_MAX; i++) {
        full.study.point[i] = (pal_wire_study_point){UINT32_MAX, "", "", 100 / 3.0, 1e-7 / 3, true, 100 / 3.0};
        memset(full.study.point[i].label, '"', PAL_WIRE_LABEL_BYTES - 1);
        memset(full.study.point[i].method, '"', PAL_WIRE_METHOD_BYTES - 1);
    }
    CHECK_INT(pal_control_put(text, sizeof text, &full, &n), 0);
    CHECK_INT(pal_control_get(text, n, true, &again), 0);
    CHECK_TEXT(again.study.point[PAL_WIRE_POINT_MAX - 1].label, full.study.point[0].label);
    CHECK(again.study.reference_m == full.study.reference_m);
}

static void writer_refuses_what_the_reader_would(void)
{
    static char text[PAL_CONTROL_OUT_MAX + 1];
    size_t n = 77;
    golden_control(PAL_CONTROL_STATUS, &c);
    CHECK_INT(pal_control_put(text, 20, &c, &n), PAL_REFUSAL_SPACE);
    CHECK_INT(pal_control_put(text, 0, &c, &n), PAL_REFUSAL_SPACE);
    c.status.rtt_ms = NAN;
    CHECK_INT(pal_control_put(text, sizeof text, &c, &n), PAL_REFUSAL_NAN);
    golden_control(PAL_CONTROL_STATUS, &c);
    c.status.n_component = PAL_WIRE_COMPONENT_MAX + 1;
    CHECK_INT(pal_control_put(text, sizeof text, &c, &n), PAL_REFUSAL_RANGE);
    golden_control(PAL_CONTROL_ERROR, &c);
    memset(c.error.text, 'x', sizeof c.error.text);
    CHECK_INT(pal_control_put(text, sizeof text, &c, &n), PAL_REFUSAL_FIELD);
    golden_control(PAL_CONTROL_ERROR, &c);
    snprintf(c.error.text, sizeof c.error.text, "two\nlines");
    CHECK_INT(pal_control_put(text, sizeof text, &c, &n), PAL_REFUSAL_FIELD);
    golden_control(PAL_CONTROL_TAKE_TOOL, &c);
    c.tool = 99;
    CHECK_INT(pal_control_put(text, sizeof text, &c, &n), PAL_REFUSAL_RANGE);
    c.type = PAL_CONTROL_COUNT;
    CHECK_INT(pal_control_put(text, sizeof text, &c, &n), PAL_REFUSAL_KIND);
    CHECK_INT(n, 77);
}

int main(void)
{
    RUN(reads_what_a_client_says);
    RUN(refuses_what_is_no_message);
    RUN(refuses_text_beyond_the_limits_before_parsing_it);
    RUN(reads_messages_of_before_fields);
    RUN(what_is_not_known_is_not_written);
    RUN(accuracy_is_said_only_where_there_is_one);
    RUN(refuses_every_prefix);
    RUN(largest_messages_fit_their_limit);
    RUN(the_largest_study_fits_its_limit);
    RUN(writer_refuses_what_the_reader_would);
    return check_report();
}
