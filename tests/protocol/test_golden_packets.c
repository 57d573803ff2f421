/* The committed golden packets: today's code reads them to the committed numbers and writes the same bytes again. */
#include "protocol/asset.h"
#include "protocol/control.h"
#include "protocol/frame_codec.h"
#include "tests/check.h"
#include "tests/protocol/golden.h"

#include <cjson/cJSON.h>

static const char *const folder = "tests/data/golden";
static cJSON *expected;

static uint8_t *load(const char *name, size_t *n_byte)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "rb");
    if (!file) return NULL;
    uint8_t *bytes = malloc(1 << 20);
    *n_byte = fread(bytes, 1, (1 << 20) - 1, file);
    bytes[*n_byte] = 0;
    fclose(file);
    return bytes;
}

static double number(const cJSON *object, const char *key)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}

/* the numbers of a list, one after another */
static double element(const cJSON *object, const char *key, int index)
{
    const cJSON *item = cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(object, key), index);
    return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}

static void pose_and_ack_are_read_and_written_as_committed(void)
{
    size_t n = 0, n_ack = 0;
    uint8_t again[PAL_WIRE_POSE_BYTES], *bytes = load("pose.bin", &n), *ack = load("ack.bin", &n_ack);
    pal_wire_pose p;
    pal_wire_ack a;
    REQUIRE(bytes && ack && pal_wire_get_pose(bytes, n, &p) == 0);
    const cJSON *e = cJSON_GetObjectItem(expected, "pose");
    CHECK_NEAR(p.tool, number(e, "tool"), 0);
    CHECK_NEAR(p.seq, number(e, "seq"), 0);
    CHECK_NEAR(p.flags, number(e, "flags"), 0);
    CHECK_NEAR((double)p.stamp_us, number(e, "stampUs"), 0);
    for (int i = 0; i < 3; i++) {
        CHECK_NEAR(p.position_m[i], element(e, "position", i), 0);
        CHECK_NEAR((double)p.velocity_m_s[i], element(e, "velocity", i), 1e-9);
        CHECK_NEAR((double)p.omega_rad_s[i], element(e, "omega", i), 1e-9);
        CHECK_NEAR((double)p.force_N[i], element(e, "force", i), 1e-7);
        CHECK_NEAR((double)p.torque_N_m[i], element(e, "torque", i), 1e-9);
    }
    for (int i = 0; i < 4; i++) CHECK_NEAR(p.quaternion[i], element(e, "quaternion", i), 0);
    CHECK_NEAR((double)p.grip, number(e, "gripper"), 1e-8);
    CHECK_NEAR(p.buttons, number(e, "buttons"), 0);
    CHECK_NEAR(p.model_seq, number(e, "modelSeq"), 0);
    CHECK_NEAR(p.model_age_us, number(e, "modelAgeUs"), 0);
    CHECK_NEAR((double)p.model_stamp_us, number(e, "modelStampUs"), 0);
    p = golden_pose();
    CHECK_INT(pal_wire_put_pose(again, sizeof again, &p), n);
    CHECK(memcmp(again, bytes, sizeof again) == 0);

    REQUIRE(pal_wire_get_ack(ack, n_ack, &a) == 0);
    e = cJSON_GetObjectItem(expected, "ack");
    CHECK_NEAR(a.cycle, number(e, "cycle"), 0);
    CHECK_NEAR(a.decode_us, number(e, "decodeUs"), 0);
    CHECK_INT(pal_wire_put_ack(again, sizeof again, &a), n_ack);
    CHECK(memcmp(again, ack, n_ack) == 0);
    free(bytes);
    free(ack);
}

static void tools_are_read_and_written_as_committed(void)
{
    static pal_wire_tools t, wanted;
    static uint8_t again[PAL_WIRE_TOOLS_MAX];
    size_t n = 0;
    uint8_t *bytes = load("tools.bin", &n);
    REQUIRE(bytes && pal_wire_get_tools(bytes, n, &t) == 0);
    wanted = golden_tools();
    const cJSON *e = cJSON_GetObjectItem(expected, "tools");
    CHECK_NEAR(t.cycle, number(e, "cycle"), 0);
    CHECK_NEAR((double)t.sim_time_us, number(e, "simTimeUs"), 0);
    for (int i = 0; i < (int)t.n_tool; i++) {
        const cJSON *tool = cJSON_GetArrayItem(cJSON_GetObjectItem(e, "tools"), i);
        CHECK_NEAR(t.tool[i].holder, number(tool, "holder"), 0);
        CHECK_NEAR(t.tool[i].flags, number(tool, "flags"), 0);
        CHECK_NEAR(t.tool[i].colour, number(tool, "colour"), 0);
        CHECK_NEAR((double)t.tool[i].radius_m, number(tool, "radius"), 1e-9);
        for (int c = 0; c < 3; c++) {
            CHECK_NEAR((double)t.tool[i].position_m[c], element(tool, "position", c), 1e-8);
            CHECK_NEAR((double)t.tool[i].force_N[c], element(tool, "force", c), 1e-8);
        }
        for (int c = 0; c < 4; c++) CHECK_NEAR((double)t.tool[i].quaternion[c], element(tool, "quaternion", c), 1e-8);
        CHECK_NEAR((double)t.tool[i].echo_stamp_us, number(tool, "echoStampUs"), 0);
        CHECK_NEAR(t.tool[i].echo_seq, number(tool, "echoSeq"), 0);
        CHECK_NEAR(t.tool[i].hold_us, number(tool, "holdUs"), 0);
    }
    CHECK_INT(pal_wire_put_tools(again, sizeof again, &wanted), n);
    CHECK(memcmp(again, bytes, n) == 0);
    free(bytes);
}

static void haptic_model_is_read_and_written_as_committed(void)
{
    uint8_t again[PAL_WIRE_HAPTIC_MAX];
    size_t n = 0;
    uint8_t *bytes = load("haptic.bin", &n);
    pal_wire_haptic h, wanted = golden_haptic();
    REQUIRE(bytes && pal_wire_get_haptic(bytes, n, &h) == 0);
    const cJSON *e = cJSON_GetObjectItem(expected, "haptic"), *grasp = cJSON_GetObjectItem(e, "grasp");
    CHECK_NEAR(h.tool, number(e, "tool"), 0);
    CHECK_NEAR(h.seq, number(e, "seq"), 0);
    CHECK_NEAR(h.flags, number(e, "flags"), 0);
    CHECK_NEAR((double)h.stamp_us, number(e, "stampUs"), 0);
    CHECK_NEAR((double)h.echo_stamp_us, number(e, "echoStampUs"), 0);
    CHECK_NEAR(h.frame_us, number(e, "frameUs"), 0);
    for (int c = 0; c < 3; c++) CHECK_NEAR(h.origin_m[c], element(e, "origin", c), 0);
    for (int c = 0; c < 3; c++) CHECK_NEAR((double)h.torque_ref_Nm[c], element(e, "torqueRef", c), 1e-8);
    for (int c = 0; c < 3; c++) CHECK_NEAR((double)h.grasp_arm_m[c], element(grasp, "arm", c), 1e-8);
    for (int c = 0; c < 6; c++) CHECK_NEAR((double)h.grasp_k_N_m[c], element(grasp, "k", c), 1e-6);
    CHECK_NEAR((double)h.grasp_b_N_s_m, number(grasp, "b"), 1e-8);
    for (int i = 0; i < (int)h.n_patch; i++) {
        const cJSON *patch = cJSON_GetArrayItem(cJSON_GetObjectItem(e, "contact_patches"), i);
        CHECK_NEAR(h.patch[i].id, number(patch, "id"), 0);
        CHECK_NEAR(h.patch[i].group, number(patch, "group"), 0);
        for (int c = 0; c < 3; c++) {
            CHECK_NEAR((double)h.patch[i].p_m[c], element(patch, "p", c), 1e-9);
            CHECK_NEAR((double)h.patch[i].n[c], element(patch, "n", c), 1e-7);
            CHECK_NEAR((double)h.patch[i].v_m_s[c], element(patch, "v", c), 1e-8);
        }
        CHECK_NEAR((double)h.patch[i].k1_N_m, number(patch, "k1"), 1e-5);
        CHECK_NEAR((double)h.patch[i].radius_m, number(patch, "radius"), 1e-8);
    }
    CHECK_INT(pal_wire_put_haptic(again, sizeof again, &wanted), n);
    CHECK(memcmp(again, bytes, n) == 0);
    free(bytes);
}

static void field_is_read_and_written_as_committed(void)
{
    static float value[GOLDEN_FIELD_VERTICES];
    static uint8_t level[GOLDEN_FIELD_VERTICES], again[4096];
    size_t n = 0, n_again = 0;
    uint8_t *bytes = load("field.bin", &n);
    pal_field_head h, wanted = golden_field(value);
    REQUIRE(bytes && pal_field_get(bytes, n, GOLDEN_FIELD_VERTICES, &h, level) == 0);
    const cJSON *e = cJSON_GetObjectItem(expected, "field");
    CHECK_NEAR(h.part, number(e, "part"), 0);
    CHECK_NEAR((int)h.field, number(e, "field"), 0);
    CHECK_NEAR(h.epoch, number(e, "epoch"), 0);
    CHECK_NEAR((double)h.sim_time_us, number(e, "simTimeUs"), 0);
    CHECK_NEAR((double)h.low, number(e, "low"), 1e-5);
    CHECK_NEAR((double)h.high, number(e, "high"), 1e-4);
    CHECK_INT(h.n_vertex, number(e, "n"));
    for (int i = 0; i < GOLDEN_FIELD_VERTICES; i++) CHECK_INT(level[i], element(e, "level", i));
    CHECK_INT(pal_field_put(value, &wanted, level, again, sizeof again, &n_again), 0);
    CHECK_INT(n_again, n);
    CHECK(memcmp(again, bytes, n) == 0);
    free(bytes);
}

static void topology_delta_is_read_and_written_as_committed(void)
{
    static uint8_t work[PAL_TOPOLOGY_DELTA_WORK_BYTES(1024)], again[4096];
    size_t n = 0, n_asset = 0, n_again = 0;
    uint8_t *bytes = load("topology_delta.bin", &n), *file = load("asset.bin", &n_asset);
    pal_asset *asset = NULL;
    pal_topology_delta_head h, wanted = golden_topology_delta();
    REQUIRE(bytes && file && pal_asset_decode(file, n_asset, &asset) == 0);
    REQUIRE(pal_topology_delta_get(bytes, n, asset->n_triangle, asset->order->n_vertex, work, &h, asset->triangle) ==
            0);
    const cJSON *e = cJSON_GetObjectItem(expected, "topology_delta");
    CHECK_NEAR(h.part, number(e, "part"), 0);
    CHECK_NEAR(h.epoch, number(e, "epoch"), 0);
    CHECK_NEAR((double)h.revision, number(e, "revision"), 0);
    CHECK_INT(h.n_changed, number(e, "n"));
    for (int i = 0; i < GOLDEN_DELTA_SLOTS; i++) CHECK_INT(golden_slot[i], element(e, "slots", i));
    for (int i = 0; i < 3 * (int)asset->n_triangle; i++) CHECK_INT(asset->triangle[i], element(e, "triangles", i));
    CHECK_INT(pal_topology_delta_put(golden_slot, asset->triangle, &wanted, work, again, sizeof again, &n_again), 0);
    CHECK_INT(n_again, n);
    CHECK(memcmp(again, bytes, n) == 0);
    pal_asset_destroy(asset);
    free(bytes);
    free(file);
}

static void asset_and_frames_are_read_to_the_committed_numbers(void)
{
    size_t n = 0;
    uint8_t *bytes = load("asset.bin", &n);
    pal_asset *asset = NULL;
    pal_frame_decoder *d = NULL;
    char hash[PAL_ASSET_HASH_CHARS];
    REQUIRE(bytes && pal_asset_decode(bytes, n, &asset) == 0);
    const cJSON *e = cJSON_GetObjectItem(expected, "asset"), *frame;
    pal_asset_hash(bytes, n, hash);
    CHECK_TEXT(hash, cJSON_GetStringValue(cJSON_GetObjectItem(e, "hash")));
    uint32_t n_vertex = asset->order->n_vertex;
    CHECK_INT(asset->order->n_level, number(e, "levels"));
    for (int i = 0; i < 3 * (int)n_vertex; i++) CHECK(asset->rest_m[i] == (float)element(e, "rest", i));
    for (int i = 0; i < 3 * (int)asset->n_triangle; i++) CHECK_INT(asset->triangle[i], element(e, "triangles", i));
    for (int i = 0; i < (int)n_vertex; i++) CHECK_INT(asset->order->vertex_of[i], element(e, "vertexOf", i));
    for (int i = 0; i < 4 * (int)n_vertex; i++) {
        CHECK_INT(asset->order->neighbour[i], element(e, "neighbour", i));
        CHECK_INT(asset->order->weight[i], element(e, "weight", i));
    }
    free(bytes);

    REQUIRE(pal_frame_decoder_create(asset, &d) == 0);
    float *position = malloc(3 * (size_t)n_vertex * sizeof *position);
    int n_frame = 0;
    cJSON_ArrayForEach(frame, cJSON_GetObjectItem(expected, "frames"))
    {
        char name[64];
        pal_frame_head head;
        snprintf(name, sizeof name, "frame_%s.bin", cJSON_GetStringValue(cJSON_GetObjectItem(frame, "name")));
        REQUIRE((bytes = load(name, &n)));
        REQUIRE(pal_frame_get(d, bytes, n, &head, position) == 0);
        CHECK_NEAR(head.part, number(frame, "part"), 0);
        CHECK_NEAR(head.epoch, number(frame, "epoch"), 0);
        CHECK_NEAR(head.seq, number(frame, "seq"), 0);
        CHECK_NEAR(head.cycle, number(frame, "cycle"), 0);
        CHECK_NEAR((double)head.sim_time_us, number(frame, "simTimeUs"), 0);
        CHECK_NEAR((double)head.q_m, number(frame, "q"), 1e-12);
        for (int i = 0; i < 3 * (int)n_vertex; i++) CHECK(position[i] == (float)element(frame, "positions", i));
        free(bytes);
        n_frame++;
    }
    CHECK_INT(n_frame, GOLDEN_FRAMES);
    free(position);
    pal_frame_decoder_destroy(d);
    pal_asset_destroy(asset);
}

static void control_lines_are_read_and_written_as_committed(void)
{
    static pal_control c;
    static char again[PAL_CONTROL_OUT_MAX + 1];
    size_t n = 0, n_again = 0;
    char *bytes = (char *)load("control.jsonl", &n), *line = bytes;
    REQUIRE(bytes);
    for (int at = 0; at < GOLDEN_CONTROL_LINES; at++) {
        const pal_control_type kind = golden_line_type(at);
        char *end = strchr(line, '\n');
        REQUIRE(end);
        *end = 0;
        CHECK_INT(pal_control_get(line, strlen(line), kind < PAL_CONTROL_JOIN, &c), 0);
        CHECK_INT(c.type, kind);
        if (kind == PAL_CONTROL_HELLO) CHECK_INT(c.hello.accuracy[0] != 0, at == PAL_CONTROL_COUNT);
        if (kind == PAL_CONTROL_HELLO) CHECK_INT(c.hello.part[1].is_adaptive, at == PAL_CONTROL_COUNT + 1);
        if (kind == PAL_CONTROL_HELLO) CHECK_INT(c.hello.part[0].is_sculptable, at == PAL_CONTROL_COUNT + 4);
        if (kind == PAL_CONTROL_HELLO) CHECK_INT(c.hello.part[0].colour[0] == '#', at == PAL_CONTROL_COUNT + 10);
        if (kind == PAL_CONTROL_HELLO) CHECK_INT(c.hello.part[0].control_cells[0] != 0, at == PAL_CONTROL_COUNT + 4);
        if (kind == PAL_CONTROL_STATUS) CHECK_INT(c.status.n_active, at == PAL_CONTROL_COUNT + 2 ? 2 : 0);
        if (kind == PAL_CONTROL_JOIN) CHECK_INT(c.join.topology_deltas, at == PAL_CONTROL_COUNT + 3);
        if (kind == PAL_CONTROL_HELLO) CHECK_INT(c.hello.estimates, at == PAL_CONTROL_COUNT + 5);
        if (kind == PAL_CONTROL_HELLO) CHECK_INT(c.hello.plan.n_part, at == PAL_CONTROL_COUNT + 5 ? 3 : 0);
        if (kind == PAL_CONTROL_TOPOLOGY) CHECK_INT(c.topology.plan.n_reason, at == PAL_CONTROL_COUNT + 6 ? 2 : 0);
        if (kind == PAL_CONTROL_STATUS) CHECK_INT(c.status.state[0].n_safeguard, at == PAL_CONTROL_COUNT + 7 ? 17 : 0);
        if (kind == PAL_CONTROL_STATUS) CHECK_INT(c.status.n_disabled, at == PAL_CONTROL_COUNT + 7);
        if (kind == PAL_CONTROL_STUDY) CHECK_INT(c.study.point[1].pareto_optimal, at == PAL_CONTROL_COUNT + 8);
        if (kind == PAL_CONTROL_ESTIMATE) CHECK_INT(isnan(c.estimate.error_m), at != PAL_CONTROL_COUNT + 9);
        /* what was read writes the same text, and so does the content itself */
        REQUIRE(pal_control_put(again, sizeof again, &c, &n_again) == 0);
        CHECK_TEXT(again, line);
        golden_line(at, &c);
        REQUIRE(pal_control_put(again, sizeof again, &c, &n_again) == 0);
        CHECK_TEXT(again, line);
        line = end + 1;
    }
    free(bytes);
}

int main(void)
{
    size_t n = 0;
    char *text = (char *)load("expected.json", &n);
    expected = text ? cJSON_Parse(text) : NULL;
    RUN(pose_and_ack_are_read_and_written_as_committed);
    RUN(tools_are_read_and_written_as_committed);
    RUN(haptic_model_is_read_and_written_as_committed);
    RUN(field_is_read_and_written_as_committed);
    RUN(topology_delta_is_read_and_written_as_committed);
    RUN(asset_and_frames_are_read_to_the_committed_numbers);
    RUN(control_lines_are_read_and_written_as_committed);
    cJSON_Delete(expected);
    free(text);
    return check_report();
}
