/* Writes the golden packets: make_golden FOLDER. Deterministic; run it only when the protocol's version changes, and
 * commit what it wrote. expected.json states every number as it was put in, and the positions as decoded here after
 * checking them against the bound. */
#include "protocol/asset.h"
#include "protocol/control.h"
#include "protocol/frame_codec.h"
#include "tests/protocol/frame_shapes.h"
#include "tests/protocol/golden.h"

#include <stdio.h>

static const char *folder;
static FILE *expected;

static void save(const char *name, const void *bytes, size_t n_byte)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "wb");
    if (!file || fwrite(bytes, 1, n_byte, file) != n_byte || fclose(file)) {
        fprintf(stderr, "%s: not written\n", path);
        exit(1);
    }
}

static void need(bool good, const char *what)
{
    if (good) return;
    fprintf(stderr, "make_golden: %s\n", what);
    exit(1);
}

static void floats(const char *key, const float *v, size_t n, const char *after)
{
    fprintf(expected, "\"%s\":[", key);
    for (size_t i = 0; i < n; i++) fprintf(expected, "%s%.9g", i ? "," : "", (double)v[i]);
    fprintf(expected, "]%s", after);
}

static void doubles(const char *key, const double *v, size_t n, const char *after)
{
    fprintf(expected, "\"%s\":[", key);
    for (size_t i = 0; i < n; i++) fprintf(expected, "%s%.17g", i ? "," : "", v[i]);
    fprintf(expected, "]%s", after);
}

static void make_pose(void)
{
    uint8_t bytes[PAL_WIRE_POSE_BYTES];
    pal_wire_pose p = golden_pose();
    need(pal_wire_put_pose(bytes, sizeof bytes, &p) == sizeof bytes, "pose");
    save("pose.bin", bytes, sizeof bytes);
    fprintf(expected, "\"pose\":{\"tool\":%u,\"seq\":%u,\"flags\":%u,\"stampUs\":%llu,", p.tool, p.seq, p.flags,
            (unsigned long long)p.stamp_us);
    doubles("position", p.position_m, 3, ",");
    doubles("quaternion", p.quaternion, 4, ",");
    floats("velocity", p.velocity_m_s, 3, ",");
    floats("omega", p.omega_rad_s, 3, ",");
    floats("force", p.force_N, 3, ",");
    floats("torque", p.torque_N_m, 3, ",");
    fprintf(expected, "\"gripper\":%.9g,\"buttons\":%u,\"modelSeq\":%u,\"modelAgeUs\":%u,\"modelStampUs\":%llu},\n",
            (double)p.grip, p.buttons, p.model_seq, p.model_age_us, (unsigned long long)p.model_stamp_us);

    pal_wire_ack a = golden_ack();
    need(pal_wire_put_ack(bytes, sizeof bytes, &a) == PAL_WIRE_ACK_BYTES, "ack");
    save("ack.bin", bytes, PAL_WIRE_ACK_BYTES);
    fprintf(expected, "\"ack\":{\"cycle\":%u,\"decodeUs\":%u},\n", a.cycle, a.decode_us);
}

static void make_tools(void)
{
    uint8_t bytes[PAL_WIRE_TOOLS_MAX];
    pal_wire_tools t = golden_tools();
    size_t n = pal_wire_put_tools(bytes, sizeof bytes, &t);
    need(n > 0, "tools");
    save("tools.bin", bytes, n);
    fprintf(expected, "\"tools\":{\"cycle\":%u,\"simTimeUs\":%llu,\"tools\":[\n", t.cycle,
            (unsigned long long)t.sim_time_us);
    for (uint32_t i = 0; i < t.n_tool; i++) {
        const pal_wire_tool *tool = &t.tool[i];
        fprintf(expected, "%s{\"holder\":%u,\"flags\":%u,\"colour\":%u,\"radius\":%.9g,", i ? ",\n" : "", tool->holder,
                tool->flags, tool->colour, (double)tool->radius_m);
        floats("position", tool->position_m, 3, ",");
        floats("quaternion", tool->quaternion, 4, ",");
        floats("force", tool->force_N, 3, ",");
        fprintf(expected, "\"echoSeq\":%u,\"holdUs\":%u,\"echoStampUs\":%llu}", tool->echo_seq, tool->hold_us,
                (unsigned long long)tool->echo_stamp_us);
    }
    fprintf(expected, "]},\n");
}

static void make_haptic(void)
{
    uint8_t bytes[PAL_WIRE_HAPTIC_MAX];
    pal_wire_haptic h = golden_haptic();
    size_t n = pal_wire_put_haptic(bytes, sizeof bytes, &h);
    need(n > 0, "haptic");
    save("haptic.bin", bytes, n);
    fprintf(expected,
            "\"haptic\":{\"tool\":%u,\"seq\":%u,\"flags\":%u,\"stampUs\":%llu,\"echoStampUs\":%llu,\"echoSeq\":%u,"
            "\"holdUs\":%u,\"frameUs\":%u,",
            h.tool, h.seq, h.flags, (unsigned long long)h.stamp_us, (unsigned long long)h.echo_stamp_us, h.echo_seq,
            h.hold_us, h.frame_us);
    doubles("origin", h.origin_m, 3, ",");
    floats("fRef", h.f_ref_N, 3, ",");
    floats("torqueRef", h.torque_ref_Nm, 3, ",\"grasp\":{");
    floats("x0", h.grasp_x0_m, 3, ",");
    floats("f0", h.grasp_f0_N, 3, ",");
    floats("k", h.grasp_k_N_m, 6, ",");
    floats("arm", h.grasp_arm_m, 3, ",");
    fprintf(expected, "\"b\":%.9g},\"contact_patches\":[\n", (double)h.grasp_b_N_s_m);
    for (uint32_t i = 0; i < h.n_patch; i++) {
        const pal_wire_contact_patch *p = &h.patch[i];
        fprintf(expected, "%s{\"id\":%u,\"group\":%u,", i ? ",\n" : "", p->id, p->group);
        floats("p", p->p_m, 3, ",");
        floats("n", p->n, 3, ",");
        floats("v", p->v_m_s, 3, ",");
        fprintf(expected, "\"k1\":%.9g,\"k2\":%.9g,\"b\":%.9g,\"kt\":%.9g,\"muS\":%.9g,\"muD\":%.9g,\"radius\":%.9g}",
                (double)p->k1_N_m, (double)p->k2_N_m2, (double)p->b_N_s_m, (double)p->kt_N_m, (double)p->mu_s,
                (double)p->mu_d, (double)p->radius_m);
    }
    fprintf(expected, "]},\n");
}

static void make_field(void)
{
    static float value[GOLDEN_FIELD_VERTICES];
    static uint8_t level[GOLDEN_FIELD_VERTICES], bytes[4096];
    pal_field_head head = golden_field(value);
    size_t n = 0;
    need(!pal_field_put(value, &head, level, bytes, sizeof bytes, &n), "field");
    need(!pal_field_get(bytes, n, GOLDEN_FIELD_VERTICES, &head, level), "field back");
    for (int i = 0; i < GOLDEN_FIELD_VERTICES; i++)
        need(fabs(pal_field_value(&head, level[i]) - (double)value[i]) <= 0.502 / 255 * (double)(head.high - head.low),
             "field bound");
    save("field.bin", bytes, n);
    fprintf(expected, "\"field\":{\"part\":%u,\"field\":%d,\"epoch\":%u,\"simTimeUs\":%llu,\"low\":%.9g,", head.part,
            (int)head.field, head.epoch, (unsigned long long)head.sim_time_us, (double)head.low);
    fprintf(expected, "\"high\":%.9g,\"n\":%u,\"level\":[", (double)head.high, head.n_vertex);
    for (int i = 0; i < GOLDEN_FIELD_VERTICES; i++) fprintf(expected, "%s%u", i ? "," : "", level[i]);
    fprintf(expected, "]},\n");
}

/* relative to the table of the golden asset, then that table as it results */
static void make_patch(const pal_asset *asset)
{
    static uint8_t work[PAL_TOPOLOGY_DELTA_WORK_BYTES(1024)], bytes[4096];
    size_t n_corner = 3 * (size_t)asset->n_triangle, n = 0;
    uint32_t *table = malloc(n_corner * sizeof *table), *again = malloc(n_corner * sizeof *again);
    memcpy(table, asset->triangle, n_corner * sizeof *table);
    memcpy(again, asset->triangle, n_corner * sizeof *again);
    for (int i = 0; i < GOLDEN_DELTA_SLOTS; i++)
        memcpy(table + 3 * (size_t)golden_slot[i], golden_corner[i], sizeof golden_corner[i]);
    pal_topology_delta_head head = golden_topology_delta();
    need(!pal_topology_delta_put(golden_slot, table, &head, work, bytes, sizeof bytes, &n), "patch");
    need(!pal_topology_delta_get(bytes, n, asset->n_triangle, asset->order->n_vertex, work, &head, again),
         "patch back");
    need(!memcmp(table, again, n_corner * sizeof *table), "patched table");
    save("topology_delta.bin", bytes, n);
    fprintf(expected, "\"topology_delta\":{\"part\":%u,\"epoch\":%u,\"revision\":%llu,\"n\":%u,\"slots\":[", head.part,
            head.epoch, (unsigned long long)head.revision, head.n_changed);
    for (int i = 0; i < GOLDEN_DELTA_SLOTS; i++) fprintf(expected, "%s%u", i ? "," : "", golden_slot[i]);
    fprintf(expected, "],\"corners\":[");
    for (int i = 0; i < 3 * GOLDEN_DELTA_SLOTS; i++)
        fprintf(expected, "%s%u", i ? "," : "", golden_corner[i / 3][i % 3]);
    fprintf(expected, "],\n\"triangles\":[");
    for (size_t i = 0; i < n_corner; i++) fprintf(expected, "%s%u", i ? "," : "", table[i]);
    fprintf(expected, "]},\n");
    free(table);
    free(again);
}

static void make_frame(const pal_asset *asset, pal_frame_encoder *e, int index, bool last)
{
    static const float affine[12] = {0.8f, -0.6f, 0, 0.5f, 0.6f, 0.8f, 0, -0.25f, 0, 0, 1, 0.125f};
    uint32_t n = asset->order->n_vertex;
    size_t cap = pal_frame_bound(n), n_number = 3 * (size_t)n;
    float *given = malloc(n_number * sizeof *given), *shown = malloc(n_number * sizeof *shown);
    uint8_t *bytes = malloc(cap);
    char name[32];
    const shape s = {n, asset->n_triangle, asset->rest_m, asset->triangle};
    shape_move(&s, golden_motion[index].motion, 20, given);
    for (size_t i = 0; i < n && golden_motion[index].affine; i++) {
        float *p = given + 3 * i, x = p[0], y = p[1];
        p[0] = 0.8f * x - 0.6f * y + 0.5f;
        p[1] = 0.6f * x + 0.8f * y - 0.25f;
        p[2] += 0.125f;
    }
    const pal_frame_input g = {2,
                               5,
                               100 + (uint32_t)index,
                               7000,
                               123456789012,
                               golden_motion[index].error_m,
                               given,
                               golden_motion[index].affine ? affine : NULL,
                               NULL};
    pal_frame_result result;
    pal_frame_head head;
    pal_frame_decoder *d = NULL;
    need(!pal_frame_put(e, &g, bytes, cap, &result), "frame encoder");
    need(!pal_frame_decoder_create(asset, &d) && !pal_frame_get(d, bytes, result.n_byte, &head, shown), "decoder");
    for (size_t i = 0; i < n_number; i++)
        need(fabs((double)given[i] - (double)shown[i]) <= result.error_m, "frame bound");
    snprintf(name, sizeof name, "frame_%s.bin", golden_motion[index].name);
    save(name, bytes, result.n_byte);
    fprintf(
        expected,
        "{\"name\":\"%s\",\"part\":%u,\"epoch\":%u,\"seq\":%u,\"cycle\":%u,\"simTimeUs\":%llu,\"q\":%.9g,\"n\":%u,\n",
        golden_motion[index].name, head.part, head.epoch, head.seq, head.cycle, (unsigned long long)head.sim_time_us,
        (double)head.q_m, head.n_vertex);
    floats("positions", shown, n_number, last ? "}\n" : "},\n");
    pal_frame_decoder_destroy(d);
    free(given);
    free(shown);
    free(bytes);
}

static void make_asset_and_frames(void)
{
    shape s = shape_create(3);
    pal_frame_order *order = NULL;
    pal_frame_encoder *e = NULL;
    uint8_t *bytes = NULL;
    size_t n_byte = 0;
    char hash[PAL_ASSET_HASH_CHARS];
    need(!pal_frame_order_create(s.rest_m, s.n_vertex, s.triangle, s.n_triangle, &order), "order");
    need(!pal_asset_encode(s.rest_m, NULL, NULL, order, s.triangle, s.n_triangle, &bytes, &n_byte), "asset");
    save("asset.bin", bytes, n_byte);
    pal_asset_hash(bytes, n_byte, hash);
    fprintf(expected, "\"asset\":{\"hash\":\"%s\",\"levels\":%u,\n", hash, order->n_level);
    floats("rest", s.rest_m, 3 * (size_t)s.n_vertex, ",\n\"triangles\":[");
    for (size_t i = 0; i < 3 * (size_t)s.n_triangle; i++) fprintf(expected, "%s%u", i ? "," : "", s.triangle[i]);
    fprintf(expected, "],\n\"vertexOf\":[");
    for (size_t i = 0; i < s.n_vertex; i++) fprintf(expected, "%s%u", i ? "," : "", order->vertex_of[i]);
    fprintf(expected, "],\n\"neighbour\":[");
    for (size_t i = 0; i < 4 * (size_t)s.n_vertex; i++) fprintf(expected, "%s%u", i ? "," : "", order->neighbour[i]);
    fprintf(expected, "],\n\"weight\":[");
    for (size_t i = 0; i < 4 * (size_t)s.n_vertex; i++) fprintf(expected, "%s%d", i ? "," : "", order->weight[i]);
    fprintf(expected, "]},\n\"frames\":[\n");
    need(!pal_frame_encoder_create(s.rest_m, order, &e), "encoder");
    const pal_asset asset = {s.n_triangle, s.rest_m, NULL, NULL, s.triangle, order};
    for (int i = 0; i < GOLDEN_FRAMES; i++) make_frame(&asset, e, i, i + 1 == GOLDEN_FRAMES);
    fprintf(expected, "],\n");
    make_patch(&asset);
    pal_frame_encoder_destroy(e);
    pal_frame_order_destroy(order);
    free(bytes);
    shape_release(&s);
}

/* one line of text per message, each also as it stands in expected.json */
static void make_control(void)
{
    static char text[PAL_CONTROL_OUT_MAX + 1], all[64 * 1024];
    size_t n_finest = 0, n_byte;
    static pal_control c;
    fprintf(expected, "\"control\":[\n");
    for (int line = 0; line < GOLDEN_CONTROL_LINES; line++) {
        golden_line(line, &c);
        need(!pal_control_put(text, sizeof text, &c, &n_byte), pal_control_name(c.type));
        fprintf(expected, "%s%s", line ? ",\n" : "", text);
        need(n_finest + n_byte + 1 <= sizeof all, "control room");
        memcpy(all + n_finest, text, n_byte);
        all[n_finest + n_byte] = '\n';
        n_finest += n_byte + 1;
    }
    save("control.jsonl", all, n_finest);
    fprintf(expected, "]}\n");
}

int main(int argc, char **argv)
{
    char path[1024];
    if (argc != 2) {
        fprintf(stderr, "usage: make_golden FOLDER\n");
        return 2;
    }
    folder = argv[1];
    snprintf(path, sizeof path, "%s/expected.json", folder);
    expected = fopen(path, "w");
    need(expected, "expected.json not written");
    fprintf(expected, "{");
    make_pose();
    make_tools();
    make_haptic();
    make_field();
    make_asset_and_frames();
    make_control();
    need(!fclose(expected), "expected.json not written");
    return 0;
}
