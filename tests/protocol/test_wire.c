/* Binary messages: refusals of everything that is not exactly one message, and SHA-256. */
#include "protocol/asset.h"
#include "protocol/refusal.h"
#include "protocol/wire.h"
#include "tests/check.h"
#include "tests/protocol/golden.h"

typedef int reader(const uint8_t *bytes, size_t n_byte);

static int read_pose(const uint8_t *bytes, size_t n_byte)
{
    pal_wire_pose out;
    return pal_wire_get_pose(bytes, n_byte, &out);
}

static int read_ack(const uint8_t *bytes, size_t n_byte)
{
    pal_wire_ack out;
    return pal_wire_get_ack(bytes, n_byte, &out);
}

static int read_tools(const uint8_t *bytes, size_t n_byte)
{
    static pal_wire_tools out;
    return pal_wire_get_tools(bytes, n_byte, &out);
}

static int read_haptic(const uint8_t *bytes, size_t n_byte)
{
    pal_wire_haptic out;
    return pal_wire_get_haptic(bytes, n_byte, &out);
}

/* the golden message of each reader; returns its bytes */
static size_t message_of(int which, uint8_t *dst, size_t cap, reader **read)
{
    static pal_wire_tools tools;
    const pal_wire_pose pose = golden_pose();
    const pal_wire_ack ack = golden_ack();
    const pal_wire_haptic haptic = golden_haptic();
    tools = golden_tools();
    static reader *const readers[] = {read_pose, read_ack, read_tools, read_haptic};
    *read = readers[which];
    return which == 0   ? pal_wire_put_pose(dst, cap, &pose)
           : which == 1 ? pal_wire_put_ack(dst, cap, &ack)
           : which == 2 ? pal_wire_put_tools(dst, cap, &tools)
                        : pal_wire_put_haptic(dst, cap, &haptic);
}

static void refuses_every_prefix_and_every_longer_message(void)
{
    for (int which = 0; which < 4; which++) {
        uint8_t bytes[4096] = {0};
        reader *read;
        size_t n = message_of(which, bytes, sizeof bytes, &read);
        CHECK_INT(read(bytes, n), PAL_REFUSAL_NONE);
        for (size_t cut = 0; cut < n; cut++) {
            uint8_t *exact = malloc(cut + 1);
            memcpy(exact, bytes, cut);
            CHECK_INT(read(exact, cut), PAL_REFUSAL_SHORT);
            free(exact);
        }
        CHECK_INT(read(bytes, n + 1), PAL_REFUSAL_LONG);
        CHECK_INT(read(bytes, sizeof bytes), PAL_REFUSAL_LONG);
    }
}

static void refuses_other_magic_kind_and_flags(void)
{
    for (int which = 0; which < 4; which++) {
        uint8_t bytes[4096];
        reader *read;
        size_t n = message_of(which, bytes, sizeof bytes, &read);
        uint8_t kind = bytes[4];
        bytes[0] ^= 1;
        CHECK_INT(read(bytes, n), PAL_REFUSAL_MAGIC);
        bytes[0] ^= 1;
        bytes[4] = kind == PAL_WIRE_POSE ? PAL_WIRE_ACK : PAL_WIRE_POSE;
        CHECK_INT(read(bytes, n), PAL_REFUSAL_KIND);
        bytes[4] = 200;
        CHECK_INT(read(bytes, n), PAL_REFUSAL_KIND);
        bytes[4] = kind;
        bytes[5] = 1;
        CHECK_INT(read(bytes, n), PAL_REFUSAL_FLAGS);
    }
}

static void writes_nothing_into_too_small_a_buffer(void)
{
    for (int which = 0; which < 4; which++) {
        uint8_t bytes[4096];
        reader *read;
        size_t n = message_of(which, bytes, sizeof bytes, &read);
        memset(bytes, 0xAA, sizeof bytes);
        CHECK_INT(message_of(which, bytes, n - 1, &read), 0);
        CHECK_INT(bytes[0], 0xAA);
        CHECK_INT(message_of(which, bytes, n, &read), n);
        CHECK_INT(bytes[n], 0xAA);
    }
}

static void refuses_poses_with_numbers_that_are_none(void)
{
    uint8_t bytes[PAL_WIRE_POSE_BYTES];
    pal_wire_pose p, out;
    memset(&out, 7, sizeof out);
    for (int i = 0; i < 7; i++) {
        p = golden_pose();
        *(i < 3 ? &p.position_m[i] : &p.quaternion[i - 3]) = i % 2 ? NAN : INFINITY;
        pal_wire_put_pose(bytes, sizeof bytes, &p);
        CHECK_INT(pal_wire_get_pose(bytes, sizeof bytes, &out), PAL_REFUSAL_NAN);
    }
    for (int i = 0; i < 13; i++) {
        p = golden_pose();
        float *const number[] = {&p.velocity_m_s[0],
                                 &p.velocity_m_s[1],
                                 &p.velocity_m_s[2],
                                 &p.omega_rad_s[0],
                                 &p.omega_rad_s[1],
                                 &p.omega_rad_s[2],
                                 &p.force_N[0],
                                 &p.force_N[1],
                                 &p.force_N[2],
                                 &p.torque_N_m[0],
                                 &p.torque_N_m[1],
                                 &p.torque_N_m[2],
                                 &p.grip};
        *number[i] = -INFINITY;
        pal_wire_put_pose(bytes, sizeof bytes, &p);
        CHECK_INT(pal_wire_get_pose(bytes, sizeof bytes, &out), PAL_REFUSAL_NAN);
    }
    CHECK_INT(out.tool, 0x0707); /* out is untouched by refusals */
}

static void refuses_poses_out_of_range(void)
{
    uint8_t bytes[PAL_WIRE_POSE_BYTES];
    pal_wire_pose p, out;
#define EXPECT(change, refusal)                                                                                        \
    do {                                                                                                               \
        p = golden_pose();                                                                                             \
        change;                                                                                                        \
        pal_wire_put_pose(bytes, sizeof bytes, &p);                                                                    \
        CHECK_INT(pal_wire_get_pose(bytes, sizeof bytes, &out), refusal);                                              \
    } while (0)
    EXPECT(p.position_m[1] = 1000.001, PAL_REFUSAL_RANGE);
    EXPECT(p.position_m[1] = -1000, PAL_REFUSAL_NONE);
    EXPECT(memset(p.quaternion, 0, sizeof p.quaternion), PAL_REFUSAL_RANGE);
    EXPECT(p.quaternion[0] *= 1.01, PAL_REFUSAL_RANGE);
    EXPECT(p.quaternion[0] *= 1.0001, PAL_REFUSAL_NONE);
    EXPECT(p.tool = PAL_WIRE_TOOL_MAX, PAL_REFUSAL_RANGE);
    EXPECT(p.flags = 512, PAL_REFUSAL_FLAGS);
    EXPECT(p.buttons = 2, PAL_REFUSAL_FLAGS);
    EXPECT(p.stamp_us = (uint64_t)1 << 53, PAL_REFUSAL_RANGE);
#undef EXPECT
}

static void refuses_contact_patches_that_are_not_passive(void)
{
    uint8_t bytes[PAL_WIRE_HAPTIC_MAX];
    pal_wire_haptic h, out;
    float *const number[] = {&h.patch[1].k1_N_m, &h.patch[1].b_N_s_m, &h.patch[1].kt_N_m,   &h.patch[1].mu_s,
                             &h.patch[1].mu_d,   &h.patch[1].n[1],    &h.patch[1].radius_m, &h.grasp_b_N_s_m};
    for (int i = 0; i < 8; i++) {
        h = golden_haptic();
        size_t n = pal_wire_put_haptic(bytes, sizeof bytes, &h);
        CHECK_INT(pal_wire_get_haptic(bytes, n, &out), PAL_REFUSAL_NONE);
        *number[i] = -0.5f;
        n = pal_wire_put_haptic(bytes, sizeof bytes, &h);
        CHECK_INT(pal_wire_get_haptic(bytes, n, &out), PAL_REFUSAL_RANGE);
    }
    h = golden_haptic();
    h.patch[0].k2_N_m2 = -100;
    size_t n = pal_wire_put_haptic(bytes, sizeof bytes, &h);
    CHECK_INT(pal_wire_get_haptic(bytes, n, &out), PAL_REFUSAL_NONE);
}

static void refuses_lying_counts(void)
{
    uint8_t bytes[PAL_WIRE_TOOLS_MAX + PAL_WIRE_HAPTIC_MAX];
    reader *read;
    size_t n = message_of(2, bytes, sizeof bytes, &read);
    bytes[6] = PAL_WIRE_TOOL_MAX;
    CHECK_INT(read(bytes, n), PAL_REFUSAL_SHORT);
    bytes[6] = 1;
    CHECK_INT(read(bytes, n), PAL_REFUSAL_LONG);
    bytes[6] = PAL_WIRE_TOOL_MAX + 1;
    CHECK_INT(read(bytes, n), PAL_REFUSAL_COUNT);
    bytes[6] = bytes[7] = 255;
    CHECK_INT(read(bytes, n), PAL_REFUSAL_COUNT);
    n = message_of(3, bytes, sizeof bytes, &read);
    bytes[44] = 3;
    CHECK_INT(read(bytes, n), PAL_REFUSAL_SHORT);
    bytes[44] = 1;
    CHECK_INT(read(bytes, n), PAL_REFUSAL_LONG);
    bytes[47] = 0xFF;
    CHECK_INT(read(bytes, n), PAL_REFUSAL_COUNT);

    static pal_wire_tools many = {.n_tool = PAL_WIRE_TOOL_MAX + 1};
    pal_wire_haptic patches = {.n_patch = PAL_WIRE_CONTACT_PATCH_MAX + 1};
    CHECK_INT(pal_wire_put_tools(bytes, sizeof bytes, &many), 0);
    CHECK_INT(pal_wire_put_haptic(bytes, sizeof bytes, &patches), 0);
}

static void asset_names_begin_as_the_sha256_vectors_of_the_standard(void)
{
    static const struct {
        const char *text, *digest;
    } vector[] = {{"", "e3b0c44298fc1c149afbf4c8996fb924"},
                  {"abc", "ba7816bf8f01cfea414140de5dae2223"},
                  {"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", "248d6a61d20638b8e5c026930c3e6039"}};
    char name[PAL_ASSET_HASH_CHARS];
    for (size_t i = 0; i < 3; i++) {
        pal_asset_hash((const uint8_t *)vector[i].text, strlen(vector[i].text), name);
        CHECK_TEXT(name, vector[i].digest);
    }
    uint8_t *million = malloc(1000000);
    memset(million, 'a', 1000000);
    pal_asset_hash(million, 1000000, name);
    CHECK_TEXT(name, "cdc76e5c9914fb9281a1c7e284d73e67");
    free(million);
}

static void every_refusal_has_a_sentence(void)
{
    for (int r = 0; r < PAL_REFUSAL_END; r++) CHECK(strlen(pal_refusal_text(r)) > 0);
    CHECK_TEXT(pal_refusal_text(-1), "unknown refusal");
}

int main(void)
{
    RUN(refuses_every_prefix_and_every_longer_message);
    RUN(refuses_other_magic_kind_and_flags);
    RUN(writes_nothing_into_too_small_a_buffer);
    RUN(refuses_poses_with_numbers_that_are_none);
    RUN(refuses_poses_out_of_range);
    RUN(refuses_contact_patches_that_are_not_passive);
    RUN(refuses_lying_counts);
    RUN(asset_names_begin_as_the_sha256_vectors_of_the_standard);
    RUN(every_refusal_has_a_sentence);
    return check_report();
}
