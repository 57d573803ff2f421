/* A body with one elastic row of tetrahedra, made by hand, for tests: a box of voxels split into five tetrahedra each,
 * with four or ten nodes, its inner nodes moved off the lattice when asked. */
#ifndef TESTS_SIM_ELASTIC_BENCH_H
#define TESTS_SIM_ELASTIC_BENCH_H
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/num/shape.h"
#include "server/sim/effect_list.h"
#include "server/sim/elastic_tet.h"
#include "tests/check.h"
#include "tests/sim/boxes.h"

typedef struct elastic_bench {
    pal_prepared box;
    pal_scene *scene;
    pal_arena *arena;
    pal_body body;
    pal_note note;
    int32_t *ten;
    pal_row row;
    pal_elastic_tets *tets;
    int n;
} elastic_bench;

static uint64_t elastic_seed = 7;
static inline double uniform(void) /* in [-1, 1) */
{
    return check_random(&elastic_seed);
}

/* ten-node elements: the middle of each edge once, behind the corners */
static inline int elastic_ten(const pal_tets *tets, int32_t *ten, double *x)
{
    int n = tets->n_node;
    for (int e = 0; e < tets->n_tet; e++) {
        memcpy(ten + 10 * e, tets->tet + 4 * e, 4 * sizeof *ten);
        for (int m = 0; m < 6; m++) {
            int a = ten[10 * e + pal_tet10_edge[m][0]], b = ten[10 * e + pal_tet10_edge[m][1]], at = -1;
            double middle[3];
            for (int c = 0; c < 3; c++) middle[c] = 0.5 * (x[3 * a + c] + x[3 * b + c]);
            for (int i = tets->n_node; i < n && at < 0; i++)
                if (pal_dist3(x + 3 * i, middle) < 1e-9 * tets->h_m) at = i;
            if (at < 0) pal_copy3(x + 3 * (at = n++), middle);
            ten[10 * e + 4 + m] = at;
        }
    }
    return n;
}

/* keys: "key=text" pairs for the row, NULL ends; material of box_scene */
static inline bool elastic_open(elastic_bench *b, pal_prepared *box, bool ten, const char *law, bool untangle)
{
    elastic_seed = 7;
    memset(b, 0, sizeof *b);
    b->box = *box;
    const pal_tets *tets = &b->box.tets;
    b->scene = box_scene(&b->box, false, false);
    b->arena = pal_arena_create(1 << 20, true);
    double *x = calloc(3 * ((size_t)tets->n_node + 6 * (size_t)tets->n_tet), sizeof *x);
    memcpy(x, tets->x, 3 * sizeof *x * (size_t)tets->n_node);
    int n_node = tets->n_node;
    if (ten) {
        b->ten = calloc(10 * (size_t)tets->n_tet, sizeof *b->ten);
        n_node = elastic_ten(tets, b->ten, x);
    }
    if (pal_body_allocate(&b->body, b->arena, n_node)) return false;
    memcpy(b->body.x_rest, x, 3 * sizeof *x * (size_t)n_node);
    memcpy(b->body.x, x, 3 * sizeof *x * (size_t)n_node);
    free(x);
    b->n = n_node;
    b->body.name = "box";
    b->body.h_m = tets->h_m;
    b->body.tets = tets;
    if (ten) b->body.element = b->ten, b->body.n_element = tets->n_tet, b->body.n_corner = 10;
    pal_build build = {.scene = b->scene, .def = b->scene->body, .body = &b->body, .arena = b->arena, .note = &b->note};
    pal_item item;
    pal_item_init(&item, "model", "tet_elastic");
    pal_item_put_text(&item, "element", ten ? "tet10" : "tet4", NULL);
    pal_item_put_text(&item, "law", law, NULL);
    pal_item_put_bool(&item, "untangle", untangle, NULL);
    b->row.effect = &pal_effect_tet_elastic;
    if (b->row.effect->make(&item, &build, &b->row.self)) {
        printf("  %s\n", b->note.text);
        return false;
    }
    b->tets = b->row.self;
    return true;
}

static inline void elastic_close(elastic_bench *b)
{
    pal_arena_destroy(b->arena);
    free(b->scene);
    free(b->ten);
    box_free(&b->box);
}

/* inner and border nodes alike leave the lattice by up to `amount` of an edge: no strips then */
static inline pal_err elastic_box(int nx, int ny, int nz, double h_m, double amount, pal_prepared *box)
{
    PAL_TRY(box_make(nx, ny, nz, h_m, box));
    for (int i = 0; i < 3 * box->tets.n_node && amount > 0; i++) box->tets.x[i] += amount * h_m * uniform();
    return PAL_ERR_OK;
}

static inline void elastic_force(elastic_bench *b)
{
    pal_step step = {.body = &b->body};
    memset(b->body.f, 0, 3 * sizeof(double) * (size_t)b->n);
    CHECK_INT(b->row.effect->run(b->row.self, &step), 0);
}

static inline double elastic_energy(elastic_bench *b)
{
    return b->row.effect->energy(b->row.self, &b->body);
}

/* x = A x_rest + shift */
static inline void elastic_place(elastic_bench *b, const double a[9], double shift)
{
    for (int i = 0; i < b->n; i++) {
        pal_mul33(b->body.x + 3 * i, a, b->body.x_rest + 3 * i);
        for (int c = 0; c < 3; c++) b->body.x[3 * i + c] += shift;
    }
}
static inline void elastic_shake(elastic_bench *b, double amount)
{
    for (int i = 0; i < 3 * b->n; i++) b->body.x[i] += amount * b->body.h_m * uniform();
}
static inline double elastic_most(const double *a, int n)
{
    double most = 0;
    for (int i = 0; i < n; i++) most = fabs(a[i]) > most || isnan(a[i]) ? fabs(a[i]) : most;
    return most;
}
static inline void elastic_turn(const double axis[3], double angle, double r[9])
{
    double n = pal_norm3(axis), s = sin(0.5 * angle) / n;
    double q[4] = {cos(0.5 * angle), s * axis[0], s * axis[1], s * axis[2]};
    pal_quat_matrix(q, r);
}
static inline double elastic_volume(const elastic_bench *b)
{
    return pal_tets_volume(&b->box.tets);
}
#endif
