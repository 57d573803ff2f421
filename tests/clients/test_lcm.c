/* LCM types, the length walk, conversions and the memory bus. */
#include "clients/link/lcm_convert.h"
#include "clients/link/lcm_link.h"
#include "palpate_answer_t.h"
#include "palpate_body_frame_t.h"
#include "palpate_haptic_config_t.h"
#include "palpate_haptic_event_t.h"
#include "palpate_haptic_status_t.h"
#include "palpate_order_t.h"
#include "palpate_session_status_t.h"
#include "palpate_triangles_t.h"
#include "server/base/key_file.h"
#include "tests/check.h"

#include <sys/stat.h>
#include <unistd.h>

static char text16[] = "sixteen letters!", text3[] = "abc", text0[] = "";

static size_t encoded(const lcm_type_info_t *type, const void *message, uint8_t *bytes, size_t cap)
{
    const int n = type->encoded_size(message);
    if (n < 0 || (size_t)n > cap || type->encode(bytes, 0, n, message) != n) return 0;
    return (size_t)n;
}

static palpate_tool_state_t a_state(void)
{
    return (palpate_tool_state_t){.utime = 123456789,
                                  .seq = 42,
                                  .version = 1,
                                  .tool = 2,
                                  .pos = {0.1, -0.2, 0.3},
                                  .quat = {0.6, 0, 0.8, 0},
                                  .vel = {1, 2, 3},
                                  .omega = {4, 5, 6},
                                  .force = {7, 8, 9},
                                  .torque = {1, 0, 1},
                                  .grip = 0.5f,
                                  .buttons = 1,
                                  .flags = 5,
                                  .model_seq = 17,
                                  .model_utime = 9876,
                                  .model_age_us = 5000};
}

static palpate_haptic_model_t a_model(palpate_contact_patch_t *patch, int n)
{
    for (int i = 0; i < n; i++)
        patch[i] = (palpate_contact_patch_t){.id = (int16_t)(i + 1),
                                             .group = 1,
                                             .p = {0, 0, 0.01f},
                                             .n = {0, 0, 1},
                                             .k1 = 300,
                                             .k2 = 10,
                                             .b = 0.5f,
                                             .radius = 0.02f};
    return (palpate_haptic_model_t){.utime = 55,
                                    .seq = 7,
                                    .version = 1,
                                    .tool = 1,
                                    .echo_utime = 44,
                                    .echo_seq = 3,
                                    .hold_us = 100,
                                    .frame_us = 16667,
                                    .origin = {1, 2, 3},
                                    .f_ref = {0, 0, 1},
                                    .n_patch = (int8_t)n,
                                    .patch = patch};
}

static void encoded_sizes_are_those_of_the_design(void)
{
    uint8_t bytes[4096];
    palpate_contact_patch_t patch[8];
    const palpate_tool_state_t state = a_state();
    CHECK_INT(encoded(palpate_tool_state_t_get_type_info(), &state, bytes, sizeof bytes), 156);
    for (int n = 0; n <= 8; n++) {
        const palpate_haptic_model_t model = a_model(patch, n);
        CHECK_INT(encoded(palpate_haptic_model_t_get_type_info(), &model, bytes, sizeof bytes), 162 + 68 * n);
    }
    /* a patch alone carries its own fingerprint of 8 bytes */
    CHECK_INT(encoded(palpate_contact_patch_t_get_type_info(), &patch[0], bytes, sizeof bytes), 8 + 68);
    const palpate_haptic_event_t event = {.kind = 4, .text = text3};
    CHECK_INT(encoded(palpate_haptic_event_t_get_type_info(), &event, bytes, sizeof bytes), 37 + 3);
    const palpate_haptic_status_t status = {.device = text16};
    CHECK_INT(encoded(palpate_haptic_status_t_get_type_info(), &status, bytes, sizeof bytes), 137);
    const palpate_haptic_config_t config = {.device = text16};
    CHECK_INT(encoded(palpate_haptic_config_t_get_type_info(), &config, bytes, sizeof bytes), 169);
}

/* every message of the package, encoded */
enum { N_TYPE = 10 };
static int all_messages(uint8_t bytes[N_TYPE][4096], size_t n[N_TYPE], const lcm_type_info_t *type[N_TYPE])
{
    palpate_contact_patch_t patch[8];
    static uint8_t payload[100];
    int32_t epoch[2] = {1, 2};
    char *asset[2] = {text16, text3};
    const palpate_tool_state_t state = a_state();
    const palpate_haptic_model_t model = a_model(patch, 4);
    const palpate_haptic_event_t event = {.kind = 4, .text = text0};
    const palpate_haptic_status_t status = {.device = text16};
    const palpate_haptic_config_t config = {.device = text3};
    const palpate_body_frame_t frame = {.size = 100, .payload = payload};
    const palpate_session_status_t session = {
        .session = text3, .organ = text16, .server = text0, .n_part = 2, .epoch = epoch, .asset = asset, .diag = text0};
    double value[2] = {0.5, -2};
    int32_t corner[6] = {0, 1, 2, 2, 1, 3};
    const palpate_order_t order = {.verb = text3, .target = text0, .n_arg = 2, .key = asset, .value = value};
    const palpate_answer_t answer = {
        .verb = text3, .code = text0, .text = text16, .n_arg = 2, .key = asset, .value = value};
    const palpate_triangles_t triangles = {.n_corner = 6, .corner = corner};
    const void *message[N_TYPE] = {&state, &model,   &event, &status, &config,
                                   &frame, &session, &order, &answer, &triangles};
    type[7] = palpate_order_t_get_type_info(), type[8] = palpate_answer_t_get_type_info();
    type[9] = palpate_triangles_t_get_type_info();
    type[0] = palpate_tool_state_t_get_type_info(), type[1] = palpate_haptic_model_t_get_type_info();
    type[2] = palpate_haptic_event_t_get_type_info(), type[3] = palpate_haptic_status_t_get_type_info();
    type[4] = palpate_haptic_config_t_get_type_info(), type[5] = palpate_body_frame_t_get_type_info();
    type[6] = palpate_session_status_t_get_type_info();
    for (int i = 0; i < N_TYPE; i++) n[i] = encoded(type[i], message[i], bytes[i], 4096);
    return N_TYPE;
}

static void walk_passes_whole_messages_and_refuses_every_cut(void)
{
    static uint8_t bytes[N_TYPE][4096];
    size_t n[N_TYPE];
    const lcm_type_info_t *type[N_TYPE];
    const int count = all_messages(bytes, n, type);
    for (int i = 0; i < count; i++) {
        CHECK(n[i] > 8);
        CHECK_INT(pal_lcm_walk(type[i], bytes[i], n[i]), PAL_WALK_OK);
        for (size_t cut = 0; cut < n[i]; cut++) {
            /* on the heap, so that a read beyond is found */
            uint8_t *copy = malloc(cut + 1);
            REQUIRE(copy);
            memcpy(copy, bytes[i], cut);
            CHECK(pal_lcm_walk(type[i], copy, cut) != PAL_WALK_OK);
            free(copy);
        }
        CHECK_INT(pal_lcm_walk(type[i], bytes[i], n[i] + 1), PAL_WALK_LONG);
        CHECK_INT(pal_lcm_walk(type[(i + 1) % count], bytes[i], n[i]), PAL_WALK_TYPE);
    }
}

static void walk_refuses_lying_counts_and_strings(void)
{
    static uint8_t bytes[N_TYPE][4096];
    size_t n[N_TYPE];
    const lcm_type_info_t *type[N_TYPE];
    all_messages(bytes, n, type);
    /* haptic_model: n_patch stands at 161 */
    CHECK_INT(bytes[1][161], 4);
    bytes[1][161] = 0x80;
    CHECK_INT(pal_lcm_walk(type[1], bytes[1], n[1]), PAL_WALK_NUMBER);
    bytes[1][161] = 5;
    CHECK_INT(pal_lcm_walk(type[1], bytes[1], n[1]), PAL_WALK_SHORT);
    bytes[1][161] = 3;
    CHECK_INT(pal_lcm_walk(type[1], bytes[1], n[1]), PAL_WALK_LONG);
    /* body_frame: size stands before the payload of 100 */
    const size_t at = n[5] - 104;
    bytes[5][at] = 0xff;
    CHECK_INT(pal_lcm_walk(type[5], bytes[5], n[5]), PAL_WALK_NUMBER);
    bytes[5][at] = 0x7f;
    CHECK_INT(pal_lcm_walk(type[5], bytes[5], n[5]), PAL_WALK_SHORT);
    /* haptic_event: empty text is its length 1 and a zero */
    bytes[2][n[2] - 1] = 'x';
    CHECK_INT(pal_lcm_walk(type[2], bytes[2], n[2]), PAL_WALK_STRING);
    bytes[2][n[2] - 1] = 0, bytes[2][n[2] - 2] = 0;
    CHECK_INT(pal_lcm_walk(type[2], bytes[2], n[2]), PAL_WALK_STRING);
    bytes[2][n[2] - 5] = 0x80;
    CHECK_INT(pal_lcm_walk(type[2], bytes[2], n[2]), PAL_WALK_STRING);
    /* haptic_status: a zero inside the device's name */
    bytes[3][n[3] - 4] = 0;
    CHECK_INT(pal_lcm_walk(type[3], bytes[3], n[3]), PAL_WALK_STRING);
}

static void walk_refuses_numbers_that_are_not_finite(void)
{
    uint8_t bytes[256];
    palpate_tool_state_t state = a_state();
    state.pos[1] = NAN;
    size_t n = encoded(palpate_tool_state_t_get_type_info(), &state, bytes, sizeof bytes);
    CHECK_INT(pal_lcm_walk(palpate_tool_state_t_get_type_info(), bytes, n), PAL_WALK_NAN);
    state = a_state();
    state.force[2] = -INFINITY;
    n = encoded(palpate_tool_state_t_get_type_info(), &state, bytes, sizeof bytes);
    CHECK_INT(pal_lcm_walk(palpate_tool_state_t_get_type_info(), bytes, n), PAL_WALK_NAN);
}

/* what the walk passes, the generated decoder reads without fault: every byte of every message changed to some values
 */
static void what_the_walk_passes_decodes(void)
{
    static uint8_t bytes[N_TYPE][4096];
    size_t n[N_TYPE];
    const lcm_type_info_t *type[N_TYPE];
    const int count = all_messages(bytes, n, type);
    const uint8_t values[] = {0, 1, 0x7f, 0x80, 0xff};
    int passed = 0;
    for (int i = 0; i < count; i++) {
        for (size_t at = 8; at < n[i]; at++) {
            for (int v = 0; v < 5; v++) {
                uint8_t *copy = malloc(n[i]);
                REQUIRE(copy);
                memcpy(copy, bytes[i], n[i]);
                copy[at] = values[v];
                if (!pal_lcm_walk(type[i], copy, n[i])) {
                    _Alignas(16) uint8_t message[1024];
                    CHECK_INT(type[i]->decode(copy, 0, (int)n[i], message), n[i]);
                    type[i]->decode_cleanup(message);
                    passed++;
                }
                free(copy);
            }
        }
    }
    CHECK(passed > 1000);
}

static void pose_survives_the_way_to_lcm_and_back(void)
{
    const pal_wire_pose p = {.tool = 3,
                             .seq = 9,
                             .flags = 37,
                             .stamp_us = 1234567,
                             .position_m = {0.1, 0.2, -0.3},
                             .quaternion = {0.8, 0, 0.6, 0},
                             .velocity_m_s = {1, 2, 3},
                             .omega_rad_s = {4, 5, 6},
                             .force_N = {7, 8, 9},
                             .torque_N_m = {1, 2, 3},
                             .grip = 0.25f,
                             .buttons = 1,
                             .model_seq = 5,
                             .model_age_us = 777,
                             .model_stamp_us = 888};
    palpate_tool_state_t state;
    uint8_t bytes[256];
    pal_wire_pose back;
    pal_lcm_from_pose(&p, &state);
    size_t n = encoded(palpate_tool_state_t_get_type_info(), &state, bytes, sizeof bytes);
    CHECK_INT(pal_lcm_to_pose(bytes, n, &back), PAL_ERR_OK);
    CHECK(memcmp(p.position_m, back.position_m, sizeof p.position_m) == 0);
    CHECK(memcmp(p.force_N, back.force_N, sizeof p.force_N) == 0);
    CHECK_INT(back.stamp_us, p.stamp_us);
    CHECK_INT(back.seq, p.seq);
    CHECK_INT(back.flags, p.flags);
    CHECK_INT(back.model_stamp_us, p.model_stamp_us);
    /* what a pose may not be */
    state.version = 2;
    n = encoded(palpate_tool_state_t_get_type_info(), &state, bytes, sizeof bytes);
    CHECK_INT(pal_lcm_to_pose(bytes, n, &back), PAL_ERR_REFUSED);
    state.version = 1, state.tool = -1;
    n = encoded(palpate_tool_state_t_get_type_info(), &state, bytes, sizeof bytes);
    CHECK_INT(pal_lcm_to_pose(bytes, n, &back), PAL_ERR_REFUSED);
    state.tool = 1, state.pos[0] = 1e6;
    n = encoded(palpate_tool_state_t_get_type_info(), &state, bytes, sizeof bytes);
    CHECK_INT(pal_lcm_to_pose(bytes, n, &back), PAL_ERR_REFUSED);
    state.pos[0] = 0, state.quat[0] = 5;
    n = encoded(palpate_tool_state_t_get_type_info(), &state, bytes, sizeof bytes);
    CHECK_INT(pal_lcm_to_pose(bytes, n, &back), PAL_ERR_REFUSED);
}

static void haptic_model_survives_the_way_to_lcm_and_back(void)
{
    pal_wire_haptic h = {.tool = 2,
                         .seq = 11,
                         .flags = 4,
                         .stamp_us = 99,
                         .echo_stamp_us = 88,
                         .echo_seq = 7,
                         .hold_us = 66,
                         .frame_us = 16667,
                         .n_patch = 3,
                         .origin_m = {0.1, 0.2, 0.3},
                         .f_ref_N = {1, 2, 3}};
    for (uint32_t i = 0; i < 3; i++)
        h.patch[i] = (pal_wire_contact_patch){.id = (uint16_t)(i + 5),
                                              .group = (uint16_t)i,
                                              .p_m = {0.001f, 0, 0},
                                              .n = {0, 0, 1},
                                              .k1_N_m = 300,
                                              .b_N_s_m = 1,
                                              .radius_m = 0.01f};
    palpate_haptic_model_t model;
    palpate_contact_patch_t patch[PAL_WIRE_CONTACT_PATCH_MAX];
    static uint8_t bytes[4096];
    static pal_wire_haptic back;
    pal_lcm_from_haptic(&h, &model, patch);
    size_t n = encoded(palpate_haptic_model_t_get_type_info(), &model, bytes, sizeof bytes);
    CHECK_INT(n, 162 + 3 * 68);
    CHECK_INT(pal_lcm_to_haptic(bytes, n, &back), PAL_ERR_OK);
    CHECK(memcmp(&h.patch, &back.patch, sizeof h.patch) == 0);
    CHECK_INT(back.seq, 11);
    CHECK_NEAR(back.origin_m[2], 0.3, 0);
    /* nine patches are more than a bridge takes */
    palpate_contact_patch_t nine[9] = {{0}};
    model.patch = nine, model.n_patch = 9;
    n = encoded(palpate_haptic_model_t_get_type_info(), &model, bytes, sizeof bytes);
    CHECK_INT(pal_lcm_walk(palpate_haptic_model_t_get_type_info(), bytes, n), PAL_WALK_OK);
    CHECK_INT(pal_lcm_to_haptic(bytes, n, &back), PAL_ERR_REFUSED);
}

static const pal_lcm_options memory = {.url = "memq://"};
static int heard, refused;
static pal_wire_pose heard_pose;
static char heard_channel[64];
static void on_message(void *user, const char *channel, const void *bytes, size_t n_byte, uint64_t source)
{
    (void)user;
    CHECK(source != 0);
    heard += pal_lcm_to_pose(bytes, n_byte, &heard_pose) == PAL_ERR_OK;
    snprintf(heard_channel, sizeof heard_channel, "%s", channel);
}
static void on_refused(void *user, const char *channel, const char *reason)
{
    (void)user, (void)channel;
    refused += !strcmp(reason, pal_walk_text(PAL_WALK_TYPE));
}

static void states_of_many_tools_come_through_the_memory_bus(void)
{
    static const pal_lcm_events events = {NULL, on_message, on_refused};
    pal_lcm_link *link = NULL;
    REQUIRE(pal_lcm_link_open(NULL, &memory, &events, NULL, NULL, &link) == PAL_ERR_OK);
    CHECK_INT(pal_lcm_link_subscribe(link, ".*/TOOL/.*", palpate_tool_state_t_get_type_info()), PAL_ERR_OK);
    for (int tool = 0; tool < 8; tool++) {
        palpate_tool_state_t state = a_state();
        state.tool = (int16_t)tool;
        CHECK_INT(pal_lcm_link_publish(link, "main", "TOOL", tool, palpate_tool_state_t_get_type_info(), &state),
                  PAL_ERR_OK);
        pal_lcm_link_handle(link);
        CHECK_INT(heard, tool + 1);
        CHECK_INT(heard_pose.tool, tool);
        CHECK_INT(pal_lcm_channel_index(heard_channel, PAL_LCM_PREFIX, "main", "TOOL"), tool);
    }
    /* another type on the same channel never reaches the decoder */
    const palpate_haptic_event_t event = {.text = text3};
    CHECK_INT(pal_lcm_link_publish(link, "main", "TOOL", 0, palpate_haptic_event_t_get_type_info(), &event),
              PAL_ERR_OK);
    pal_lcm_link_handle(link);
    CHECK_INT(refused, 1);
    CHECK_INT(heard, 8);
    pal_lcm_link_close(link);
}

static bool wants_first(void *user, const char *channel)
{
    (void)user;
    return pal_lcm_channel_index(channel, "left", "main", "TOOL") == 0;
}

/* another rig, with a prefix of its own, is neither heard nor refused */
static void a_rig_has_channels_of_its_own(void)
{
    static const pal_lcm_events events = {wants_first, on_message, on_refused};
    const pal_lcm_options left = {.url = "memq://", .prefix = "left"};
    const palpate_tool_state_t state = a_state();
    const palpate_haptic_event_t event = {.text = text3};
    pal_lcm_link *link = NULL;
    heard = refused = 0;
    REQUIRE(pal_lcm_link_open(NULL, &left, &events, NULL, NULL, &link) == PAL_ERR_OK);
    CHECK_TEXT(pal_lcm_link_prefix(link), "left");
    pal_lcm_link_subscribe(link, ".*/TOOL/.*", palpate_tool_state_t_get_type_info());
    for (int tool = 0; tool < 3; tool++) {
        CHECK_INT(pal_lcm_link_publish(link, "main", "TOOL", tool, palpate_tool_state_t_get_type_info(), &state), 0);
        CHECK_INT(pal_lcm_link_publish(link, "other", "TOOL", tool, palpate_haptic_event_t_get_type_info(), &event), 0);
        pal_lcm_link_handle(link);
    }
    CHECK_INT(heard, 1);
    CHECK_INT(refused, 0);
    CHECK_TEXT(heard_channel, "left/main/TOOL/0");
    pal_lcm_link_close(link);
}

/* a key file that the environment names signs as one that a flag names, and its rights are checked the same */
static void the_environment_names_the_key(void)
{
    static const pal_lcm_events events = {NULL, on_message, on_refused};
    const palpate_tool_state_t state = a_state();
    char path[] = "/tmp/test_lcm_keyXXXXXX";
    int id;
    pal_diagnostic diag = {""};
    pal_lcm_link *link = NULL;
    const int fd = mkstemp(path);
    REQUIRE(fd >= 0);
    close(fd);
    REQUIRE(pal_key_file_add(path, &id, &diag) == PAL_ERR_OK);
    setenv("PALPATE_LCM_KEY", path, true);
    chmod(path, 0644);
    CHECK_INT(pal_lcm_link_open(NULL, &memory, &events, NULL, &diag, &link), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "chmod 600"));
    chmod(path, 0600);
    heard = 0;
    REQUIRE(pal_lcm_link_open(NULL, &memory, &events, NULL, &diag, &link) == PAL_ERR_OK);
    unsetenv("PALPATE_LCM_KEY");
    unlink(path);
    pal_lcm_link_subscribe(link, ".*/TOOL/.*", palpate_tool_state_t_get_type_info());
    CHECK_INT(pal_lcm_link_publish(link, "main", "TOOL", 0, palpate_tool_state_t_get_type_info(), &state), PAL_ERR_OK);
    pal_lcm_link_handle(link);
    CHECK_INT(heard, 1);
    CHECK(pal_lcm_link_is_keyed(link));
    pal_lcm_link_close(link);
}

static size_t n_byte_heard;
static void on_frame(void *user, const char *channel, const void *bytes, size_t n_byte, uint64_t source)
{
    (void)user, (void)channel, (void)source;
    palpate_body_frame_t frame;
    if (palpate_body_frame_t_decode(bytes, 0, (int)n_byte, &frame) < 0) return;
    bool same = true;
    for (int i = 0; i < frame.size; i++) same &= frame.payload[i] == (uint8_t)(i % 251);
    n_byte_heard = same ? (size_t)frame.size : 0;
    palpate_body_frame_t_decode_cleanup(&frame);
}

/* one datagram holds 65,507 bytes */
static void frames_come_whole_whatever_their_size(void)
{
    static const pal_lcm_events events = {NULL, on_frame, NULL};
    static uint8_t payload[1000000];
    const int size[] = {1000, 1000000, 65000, 70000, 0};
    pal_lcm_link *link = NULL;
    for (int i = 0; i < 1000000; i++) payload[i] = (uint8_t)(i % 251);
    REQUIRE(pal_lcm_link_open(NULL, &memory, &events, NULL, NULL, &link) == PAL_ERR_OK);
    pal_lcm_link_subscribe(link, ".*/BODY/.*", palpate_body_frame_t_get_type_info());
    for (size_t k = 0; k < sizeof size / sizeof *size; k++) {
        const palpate_body_frame_t frame = {.size = size[k], .payload = payload};
        n_byte_heard = 1;
        CHECK_INT(pal_lcm_link_publish(link, "main", "BODY", 0, palpate_body_frame_t_get_type_info(), &frame),
                  PAL_ERR_OK);
        pal_lcm_link_handle(link);
        CHECK_INT(n_byte_heard, size[k]);
    }
    pal_lcm_link_close(link);
}

static void channels_are_named_and_read_back_exactly(void)
{
    char channel[PAL_LCM_CHANNEL_MAX + 1];
    pal_lcm_channel(channel, PAL_LCM_PREFIX, "main", "HMODEL", 3);
    CHECK_TEXT(channel, "PALPATE1/main/HMODEL/3");
    pal_lcm_channel(channel, PAL_LCM_PREFIX, "main", "STATUS", -1);
    CHECK_TEXT(channel, "PALPATE1/main/STATUS");
    pal_lcm_channel(channel, PAL_LCM_PREFIX, "a/b *c\n", "TOOL", 0);
    CHECK_TEXT(channel, "PALPATE1/a_b__c_/TOOL/0");
    char longest[300];
    memset(longest, 'x', sizeof longest - 1);
    longest[sizeof longest - 1] = 0;
    pal_lcm_channel(channel, PAL_LCM_PREFIX, longest, "HSTATUS", 31);
    CHECK(strlen(channel) <= 63);
    CHECK_INT(pal_lcm_channel_index(channel, PAL_LCM_PREFIX, longest, "HSTATUS"), 31);
    CHECK_INT(pal_lcm_channel_index("PALPATE1/main/TOOL/7", PAL_LCM_PREFIX, "main", "TOOL"), 7);
    CHECK_INT(pal_lcm_channel_index("PALPATE1/main/TOOL/07", PAL_LCM_PREFIX, "main", "TOOL"), -1);
    CHECK_INT(pal_lcm_channel_index("PALPATE1/main/TOOL/", PAL_LCM_PREFIX, "main", "TOOL"), -1);
    CHECK_INT(pal_lcm_channel_index("PALPATE1/other/TOOL/7", PAL_LCM_PREFIX, "main", "TOOL"), -1);
    CHECK_INT(pal_lcm_channel_index("PALPATE1/main/TOOL/99999999999", PAL_LCM_PREFIX, "main", "TOOL"), -1);
}

static void refuses_addresses_that_are_not_a_bus(void)
{
    static const pal_lcm_events events = {NULL, on_message, NULL};
    pal_lcm_link *link = NULL;
    pal_diagnostic diag = {""};
    CHECK_INT(pal_lcm_link_open(NULL, &(pal_lcm_options){.url = "tcpq://x"}, &events, NULL, &diag, &link),
              PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "tcpq://x") != NULL);
    CHECK_INT(pal_lcm_link_open(NULL, &(pal_lcm_options){.url = "file:///etc/passwd"}, &events, NULL, &diag, &link),
              PAL_ERR_REFUSED);
    const char *prefix[] = {"", "a/b", "thirteen-long", "a*"};
    for (int i = 0; i < 4; i++) {
        const pal_lcm_options bad = {.url = "memq://", .prefix = prefix[i]};
        CHECK_INT(pal_lcm_link_open(NULL, &bad, &events, NULL, &diag, &link), PAL_ERR_REFUSED);
        CHECK(strstr(diag.text, "1 to 12 letters"));
    }
}

int main(void)
{
    RUN(encoded_sizes_are_those_of_the_design);
    RUN(walk_passes_whole_messages_and_refuses_every_cut);
    RUN(walk_refuses_lying_counts_and_strings);
    RUN(walk_refuses_numbers_that_are_not_finite);
    RUN(what_the_walk_passes_decodes);
    RUN(pose_survives_the_way_to_lcm_and_back);
    RUN(haptic_model_survives_the_way_to_lcm_and_back);
    RUN(states_of_many_tools_come_through_the_memory_bus);
    RUN(a_rig_has_channels_of_its_own);
    RUN(the_environment_names_the_key);
    RUN(frames_come_whole_whatever_their_size);
    RUN(channels_are_named_and_read_back_exactly);
    RUN(refuses_addresses_that_are_not_a_bus);
    return check_report();
}
