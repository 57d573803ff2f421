/* FRAME codec: bound, size, closed loop, hostile messages. */
#include "protocol/asset.h"
#include "protocol/frame_codec.h"
#include "tests/check.h"
#include "tests/protocol/shapes.h"

typedef struct rig { /* a surface with encoder and decoder */
    shape s;
    pal_frame_order *order;
    pal_asset asset;
    pal_frame_encoder *e;
    pal_frame_decoder *d;
    float *given, *shown;
    uint8_t *bytes;
    size_t cap;
} rig;

static bool rig_create(rig *r, int fineness)
{
    *r = (rig){.s = shape_create(fineness)};
    if (pal_frame_order_create(r->s.rest_m, r->s.n_vertex, r->s.triangle, r->s.n_triangle, &r->order)) return false;
    r->asset = (pal_asset){r->s.n_triangle, r->s.rest_m, r->s.triangle, r->order};
    if (pal_frame_encoder_create(r->s.rest_m, r->order, &r->e)) return false;
    if (pal_frame_decoder_create(&r->asset, &r->d)) return false;
    r->cap = pal_frame_bound(r->s.n_vertex);
    r->given = malloc(3 * (size_t)r->s.n_vertex * sizeof *r->given);
    r->shown = malloc(3 * (size_t)r->s.n_vertex * sizeof *r->shown);
    r->bytes = malloc(r->cap);
    return r->given && r->shown && r->bytes;
}

static void rig_release(rig *r)
{
    pal_frame_encoder_destroy(r->e);
    pal_frame_decoder_destroy(r->d);
    pal_frame_order_destroy(r->order);
    shape_release(&r->s);
    free(r->given);
    free(r->shown);
    free(r->bytes);
}

static double largest_error(const rig *r)
{
    double most = 0;
    for (size_t i = 0; i < 3 * (size_t)r->s.n_vertex; i++) {
        double error = fabs((double)r->given[i] - (double)r->shown[i]);
        if (!(error <= most)) most = error;
    }
    return most;
}

static pal_frame_given given_of(const rig *r, double error_m)
{
    return (pal_frame_given){.part = 1,
                             .epoch = 3,
                             .seq = 7,
                             .cycle = 9,
                             .sim_time_us = 1234567,
                             .error_m = error_m,
                             .position_m = r->given};
}

static void error_stays_within_its_bound_in_every_frame(void)
{
    static const double bound[] = {1e-5, 5e-5, 2.5e-4};
    rig r;
    REQUIRE(rig_create(&r, 24));
    for (size_t b = 0; b < 3; b++) {
        pal_frame_given given = given_of(&r, bound[b]);
        for (int motion = 0; motion < MOTION_COUNT; motion++) {
            for (int k = 0; k < 25; k++) {
                pal_frame_result result;
                pal_frame_head head;
                shape_move(&r.s, (shape_motion)motion, k * 4, r.given);
                REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
                REQUIRE(pal_frame_get(r.d, r.bytes, result.n_byte, &head, r.shown) == 0);
                CHECK_LE(largest_error(&r), result.error_m);
                if (motion != MOTION_TELEPORT) CHECK_LE(result.error_m, bound[b]);
                CHECK_INT(head.epoch, 3);
            }
        }
    }
    rig_release(&r);
}

static void live_deformation_costs_less_than_half_a_byte_per_vertex(void)
{
    static const double most[MOTION_COUNT] = {0.01, 0.25, 0.3, 0.45, 0.1, 0, 0, 0};
    rig r;
    REQUIRE(rig_create(&r, 70));
    pal_frame_given given = given_of(&r, 5e-5);
    for (int motion = 0; motion < MOTION_TELEPORT; motion++) {
        double n_byte = 0;
        for (int k = 0; k < 10; k++) {
            pal_frame_result result;
            shape_move(&r.s, (shape_motion)motion, k * 10, r.given);
            REQUIRE(pal_frame_put(r.e, &given, r.bytes, r.cap, &result) == 0);
            n_byte += (double)result.n_byte / 10;
        }
        printf("  motion %d: %.0f bytes a frame, %.3f a vertex\n", motion, n_byte, n_byte / r.s.n_vertex);
        CHECK_LE(n_byte / r.s.n_vertex, most[motion]);
    }
    rig_release(&r);
}

int main(void)
{
    RUN(error_stays_within_its_bound_in_every_frame);
    RUN(live_deformation_costs_less_than_half_a_byte_per_vertex);
    return check_report();
}
