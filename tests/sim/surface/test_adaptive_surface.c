/* Adaptive surfaces: counts of the paper, masses, 2:1, triangles, slots, states that come back, limits, refusals. */
#include "tests/fixtures/adaptive_moves.h"

/* C, Table I: V' = V + E, E' = 4 E */
static void counts_of_full_refinement_are_those_of_table_1(void)
{
    const int want[2][3][2] = {{{114, 336}, {450, 1344}, {1794, 5376}}, {{188, 558}, {746, 2232}, {2978, 8928}}};
    for (int shape = SPHERE; shape <= STOMACH; shape++)
        for (int level = 0; level < 3; level++) {
            thing t = make(shape, (pal_adaptive_options){.n_level = 3, .start_level = level});
            pal_adaptive_surface *s = t.adaptive;
            CHECK_INT(s->n_node, want[shape][level][0]);
            CHECK_INT(s->n_spring, want[shape][level][1]);
            CHECK_INT(t.body.n_active, s->n_node);
            CHECK_INT(s->n_leaf, 2 * s->n_spring / 3);
            CHECK_INT(s->n_tri, s->n_leaf);
            CHECK_INT(s->finest, level);
            CHECK_NEAR(s->mass_scale, 1, 1e-12);
            CHECK_NEAR(total_mass(&t.body) / 0.3, 1, 1e-13);
            /* the same by splitting leaf by leaf */
            pal_adaptive_set_level(s, &t.body, 0);
            for (int k = 0; k < level; k++)
                for (int32_t f = s->levels.first_face[k]; f < s->levels.first_face[k + 1]; f++)
                    CHECK_INT(pal_adaptive_split(s, &t.body, f, 0), 1);
            pal_adaptive_update(s, &t.body);
            CHECK_INT(s->n_node, want[shape][level][0]);
            CHECK_INT(s->n_spring, want[shape][level][1]);
            give_back(&t);
        }
}

static int compare_keys(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

static int has_key(const uint64_t *key, int n, uint64_t wanted)
{
    return bsearch(&wanted, key, (size_t)n, sizeof *key, compare_keys) != NULL;
}

/* edges of what is drawn that are run through twice the same way, and those without an opposite that are not rim */
static int count_cracks(const pal_adaptive_surface *s)
{
    int n = 3 * s->n_tri, cracks = 0;
    uint64_t *key = malloc((size_t)n * sizeof *key);
    for (int t = 0; t < s->n_tri; t++)
        for (int k = 0; k < 3; k++)
            key[3 * t + k] = (uint64_t)s->tri[3 * t + k] << 32 | (uint32_t)s->tri[3 * t + (k + 1) % 3];
    qsort(key, (size_t)n, sizeof *key, compare_keys);
    for (int i = 0; i < n; i++) {
        int32_t u = (int32_t)(key[i] >> 32), v = (int32_t)(key[i] & 0xffffffff);
        cracks += (i > 0 && key[i] == key[i - 1]) || u == v;
        bool rim = pal_levels_on_boundary(&s->levels, u) && pal_levels_on_boundary(&s->levels, v);
        if (!rim) cracks += !has_key(key, n, (uint64_t)(uint32_t)v << 32 | (uint32_t)u);
    }
    free(key);
    return cracks;
}

/* leaves with a neighbour two levels finer: a side whose half is split itself */
static int count_steep(const pal_adaptive_surface *s)
{
    const pal_levels *l = &s->levels;
    int steep = 0;
    for (int i = 0; i < s->n_leaf; i++)
        for (int k = 0; k < 3; k++) {
            int32_t half = pal_levels_edge_half(l, l->face_edge[3 * s->leaf[i] + k], 0);
            steep += half >= 0 && (s->edge_split[half] || s->edge_split[half + 1]);
        }
    return steep;
}

/* nodes beside split faces and no others, the rest as nobody ever touched it */
static int count_odd_nodes(const thing *t)
{
    const pal_body *b = &t->body;
    const double zero[3] = {0, 0, 0};
    int odd = 0, n = 0;
    for (int v = 0; v < b->n_node; v++) {
        size_t at = 3 * (size_t)v;
        if (pal_adaptive_has(t->adaptive, v)) {
            n++;
            odd += !(b->mass_kg[v] > 0);
            continue;
        }
        odd += memcmp(b->x + at, b->x_rest + at, sizeof zero) || memcmp(b->v + at, zero, sizeof zero) ||
               memcmp(b->f + at, zero, sizeof zero) || memcmp(b->load + at, zero, sizeof zero) || b->mass_kg[v] != 0;
    }
    for (int k = 0; k < b->n_active; k++) odd += !pal_adaptive_has(t->adaptive, b->active[k]);
    return odd + abs(n - b->n_active);
}

/* places that differ from the triangles of the leaves, those that nobody owns being empty */
static int count_odd_places(const pal_adaptive_surface *s)
{
    int32_t *want = calloc(3 * (size_t)s->n_slot, sizeof *want), tri[4][3];
    int odd = 0, n_tri = 0;
    for (int i = 0; i < s->n_leaf; i++) {
        int n = pal_adaptive_triangles(s, s->leaf[i], tri);
        memcpy(want + 3 * (size_t)pal_adaptive_triangle_slot(s, s->leaf[i]), tri, (size_t)n * sizeof *tri);
        odd += memcmp(s->tri + 3 * (size_t)n_tri, tri, (size_t)n * sizeof *tri) != 0;
        n_tri += n;
    }
    odd += n_tri != s->n_tri || s->surface.n_tri != s->n_tri || s->surface.tri != s->tri;
    for (int i = 0; i < 3 * s->n_slot; i++) odd += want[i] != s->slot[i];
    free(want);
    return odd;
}

static void every_state_is_balanced_watertight_and_of_the_same_mass(void)
{
    int64_t seen[5] = {0};
    for (int shape = SPHERE; shape <= SHEET; shape++) {
        thing t = make(shape, (pal_adaptive_options){.n_level = 4});
        pal_adaptive_surface *s = t.adaptive;
        dice d = {.seed = 7 + (uint64_t)shape};
        double worst_mass = 0;
        int cracks = 0, steep = 0, nodes = 0, places = 0, counts = 0, changes = 0;
        for (int round = 0; round < CHECK_REPEATS(60, 15); round++) {
            /* what a step leaves at nodes goes with them */
            for (int k = 0; k < t.body.n_active; k++)
                t.body.f[3 * t.body.active[k]] = t.body.v[3 * t.body.active[k] + 1] =
                    t.body.load[3 * t.body.active[k] + 2] = 1;
            changes += stir(&t, &d, 1 + 3 * round, 0);
            pal_adaptive_update(s, &t.body);
            worst_mass = fmax(worst_mass, fabs(total_mass(&t.body) / 0.3 - 1));
            cracks += count_cracks(s), steep += count_steep(s), nodes += count_odd_nodes(&t);
            places += count_odd_places(s);
            int32_t tri[4][3];
            for (int i = 0; i < s->n_leaf; i++) seen[pal_adaptive_triangles(s, s->leaf[i], tri)]++;
            /* what is drawn: edges are springs, or divide a leaf; V - E + F is 2 for a ball, 1 for a sheet */
            int n_edge = s->n_spring + s->n_tri - s->n_leaf;
            counts += s->n_node - n_edge + s->n_tri != (shape == SHEET ? 1 : 2);
            if (shape != SHEET) counts += 2 * n_edge != 3 * s->n_tri;
        }
        CHECK(changes > 20);
        CHECK_INT(s->finest, 3);
        CHECK_LE(worst_mass, 1e-13);
        CHECK_INT(cracks, 0);
        CHECK_INT(steep, 0);
        CHECK_INT(nodes, 0);
        CHECK_INT(places, 0);
        CHECK_INT(counts, 0);
        give_back(&t);
    }
    /* C, fig. 4: types 1-4 all occur */
    for (int n = 1; n <= 4; n++) CHECK(seen[n] > 0);
}

/* paper C, eq. 6 and 7, counted edge by edge over all levels */
static void mixed_nodes_weigh_the_mean_of_their_springs_levels(void)
{
    thing t = make(STOMACH, (pal_adaptive_options){.n_level = 3});
    pal_adaptive_surface *s = t.adaptive;
    const pal_levels *l = &s->levels;
    dice d = {.seed = 3};
    stir(&t, &d, 40, 0);
    pal_adaptive_update(s, &t.body);
    stir(&t, &d, 40, 0);
    pal_adaptive_update(s, &t.body);
    double *mass = calloc((size_t)t.body.n_node, sizeof *mass), *n = calloc((size_t)t.body.n_node, sizeof *n);
    int n_spring = 0, n_mixed = 0;
    for (int32_t e = 0; e < l->first_edge[l->n_level]; e++) {
        bool leaf = false;
        for (int side = 0; side < 2; side++)
            leaf = leaf || (l->edge[e].face[side] >= 0 && s->face_state[l->edge[e].face[side]] == PAL_FACE_LEAF);
        if (!leaf || s->edge_split[e]) continue;
        n_spring++;
        for (int end = 0; end < 2; end++)
            mass[l->edge[e].vertex[end]] += 0.3 / l->n_vertex[l->edge_level[e]], n[l->edge[e].vertex[end]] += 1;
    }
    CHECK_INT(s->n_spring, n_spring);
    for (int v = 0; v < t.body.n_node; v++)
        if (n[v] > 0) {
            double want = s->mass_scale * mass[v] / n[v];
            CHECK_NEAR(t.body.mass_kg[v] / want, 1, 1e-12);
            bool pure = false;
            for (int k = 0; k < 3; k++) pure = pure || fabs(mass[v] / n[v] / s->level_mass_kg[k] - 1) < 1e-12;
            n_mixed += !pure;
        }
    CHECK(n_mixed > 10);
    CHECK(fabs(s->mass_scale - 1) > 1e-4 && fabs(s->mass_scale - 1) < 0.5);
    free(mass);
    free(n);
    give_back(&t);
}

/* where a plain sum is off by more than 1e-12 */
static void a_hundred_thousand_nodes_weigh_what_they_should(void)
{
    thing t = make(SPHERE, (pal_adaptive_options){.n_level = 6});
    pal_adaptive_surface *s = t.adaptive;
    for (int32_t f = 0; f < s->levels.first_face[5]; f++)
        if (f % 7) pal_adaptive_split(s, &t.body, f, 0);
    pal_adaptive_update(s, &t.body);
    CHECK(s->n_node > 100000 && s->n_leaf_of[4] > 0);
    CHECK_NEAR(total_mass(&t.body) / 0.3, 1, 1e-13);
    give_back(&t);
}

/* masses by faces: a third of the mass of every face around, and a switch moves none beyond its own triangles */
static void masses_by_faces_change_only_where_faces_do(void)
{
    thing t = make(STOMACH, (pal_adaptive_options){.n_level = 3, .mass = PAL_MASS_BY_FACES});
    pal_adaptive_surface *s = t.adaptive;
    const pal_levels *l = &s->levels;
    const int n0 = l->n_vertex[0];
    double third = 0.3 / pal_levels_n_face(l, 0) / 3;
    int *around = calloc((size_t)n0, sizeof *around), far = 0, near = 0;
    double *was = calloc((size_t)n0, sizeof *was);
    for (int i = 0; i < 3 * pal_levels_n_face(l, 0); i++) around[l->face[i]]++;
    for (int v = 0; v < n0; v++) {
        CHECK_NEAR(t.body.mass_kg[v] / (around[v] * third), 1, 1e-13);
        was[v] = t.body.mass_kg[v];
    }
    const int32_t face = l->first_face[0] + 40;
    CHECK_INT(pal_adaptive_split(s, &t.body, face, 0), 1);
    pal_adaptive_update(s, &t.body);
    CHECK_NEAR(total_mass(&t.body) / 0.3, 1, 1e-13);
    for (int v = 0; v < n0; v++) {
        bool touched = false;
        for (int k = 0; k < 3; k++) {
            const pal_winged_edge *e = &l->edge[l->face_edge[3 * face + k]];
            for (int side = 0; side < 2; side++)
                for (int c = 0; c < 3; c++) touched = touched || l->face[3 * e->face[side] + c] == v;
        }
        far += !touched;
        near += fabs(t.body.mass_kg[v] / was[v] - 1) > 1e-3;
        if (!touched) CHECK_NEAR(t.body.mass_kg[v] / was[v], 1, 1e-13);
    }
    CHECK(far > 150 && near >= 3);
    /* a midpoint has a quarter from each of the three small faces beside it, and half of each half of the neighbour */
    CHECK_NEAR(t.body.mass_kg[pal_levels_edge_midpoint(l, l->face_edge[3 * face])] / third, 3 * 0.25 + 2 * 0.5, 1e-12);
    free(around);
    free(was);
    give_back(&t);
}

static void the_log_replays_to_the_table(void)
{
    thing t = make(SPHERE, (pal_adaptive_options){.n_level = 4});
    pal_adaptive_surface *s = t.adaptive;
    dice d = {.seed = 5};
    size_t size = 3 * (size_t)s->n_slot * sizeof *s->slot;
    int32_t *copy = malloc(size);
    memcpy(copy, s->slot, size);
    uint64_t seen = s->n_log;
    int same = 0, rounds = CHECK_REPEATS(200, 50), copied = 0;
    CHECK_INT(seen, 0);
    for (int round = 0; round < rounds; round++) {
        stir(&t, &d, 1 + roll(&d, 6), 0);
        if (round % 50 == 20) pal_adaptive_set_level(s, &t.body, roll(&d, 3));
        pal_adaptive_update(s, &t.body);
        if (s->n_log - seen > (uint64_t)s->n_log_room)
            copied++, memcpy(copy, s->slot, size);
        else
            for (uint64_t i = seen; i < s->n_log; i++) {
                int32_t p = s->log[i % (uint64_t)s->n_log_room];
                memcpy(copy + 3 * p, s->slot + 3 * p, 3 * sizeof *copy);
            }
        seen = s->n_log;
        same += !memcmp(copy, s->slot, size);
    }
    CHECK_INT(same, rounds);
    CHECK(copied < rounds / 10);
    /* nothing changes, nothing is logged */
    CHECK(!pal_adaptive_update(s, &t.body));
    CHECK_INT(s->n_log, seen);
    free(copy);
    give_back(&t);
}

/* ---- states that come back ---- */

typedef struct record {
    size_t n;
    unsigned char *byte;
} record;

static void put(record *r, const void *from, size_t n)
{
    r->byte = realloc(r->byte, r->n + n + 1);
    if (n) memcpy(r->byte + r->n, from, n);
    r->n += n;
}

/* every bit that a step could see */
static record record_of(const thing *t)
{
    const pal_adaptive_surface *s = t->adaptive;
    const pal_body *b = &t->body;
    record r = {0};
    size_t n = (size_t)b->n_node;
    put(&r, b->x, 24 * n), put(&r, b->v, 24 * n), put(&r, b->f, 24 * n), put(&r, b->load, 24 * n);
    put(&r, b->mass_kg, 8 * n), put(&r, b->support, n);
    put(&r, s->face_state, (size_t)s->levels.first_face[s->levels.n_level]);
    put(&r, s->edge_split, (size_t)s->levels.first_edge[s->levels.n_level]);
    put(&r, s->leaf, 4 * (size_t)s->n_leaf), put(&r, s->spring, 4 * (size_t)s->n_spring);
    put(&r, s->spring_share, 4 * (size_t)s->n_spring), put(&r, s->node, 4 * (size_t)s->n_node);
    put(&r, s->slot, 12 * (size_t)s->n_slot), put(&r, s->tri, 12 * (size_t)s->n_tri);
    put(&r, s->n_leaf_of, sizeof s->n_leaf_of);
    double few[5] = {s->mass_scale, s->rest_kg_m2, s->rest_centre_m[0], s->rest_centre_m[1], s->rest_centre_m[2]};
    put(&r, few, sizeof few);
    return r;
}

static bool same_record(record a, record b)
{
    bool same = a.n == b.n && !memcmp(a.byte, b.byte, a.n);
    free(a.byte);
    free(b.byte);
    return same;
}

/* joins whatever can be joined until the surface is coarse */
static void join_all(thing *t)
{
    pal_adaptive_surface *s = t->adaptive;
    for (int32_t f = s->levels.first_face[s->levels.n_level - 1] - 1; f >= 0; f--) pal_adaptive_join(s, &t->body, f);
}

static void ten_thousand_random_changes_and_back_leave_every_bit(void)
{
    thing t =
        make(STOMACH, (pal_adaptive_options){.n_level = 4, .place = PAL_MIDPOINT_BUTTERFLY, .mass = PAL_MASS_BY_FACES});
    dice d = {.seed = 11};
    shake(&t, 1);
    record before = record_of(&t);
    int done = 0, wanted = CHECK_REPEATS(10000, 1500), max = 0;
    for (int n = 0; done < wanted; n++) {
        done += stir(&t, &d, 1 + roll(&d, 8), 3000);
        pal_adaptive_update(t.adaptive, &t.body);
        if (t.adaptive->n_node > max) max = t.adaptive->n_node;
        /* from time to time all the way back, so that it is not one long walk */
        if (n % 500 == 499) {
            join_all(&t);
            pal_adaptive_update(t.adaptive, &t.body);
            CHECK_INT(t.adaptive->n_node, 188);
        }
    }
    CHECK(max > 800);
    join_all(&t);
    CHECK(pal_adaptive_update(t.adaptive, &t.body));
    CHECK(same_record(before, record_of(&t)));
    give_back(&t);
}

static void the_same_state_by_another_way_has_the_same_lists(void)
{
    thing t = make(SPHERE, (pal_adaptive_options){.n_level = 4}),
          u = make(SPHERE, (pal_adaptive_options){.n_level = 4});
    pal_adaptive_surface *s = t.adaptive, *o = u.adaptive;
    dice d = {.seed = 21};
    for (int k = 0; k < 20; k++) stir(&t, &d, 20, 0), pal_adaptive_update(s, &t.body);
    /* from the finest state down to that one */
    pal_adaptive_set_level(o, &u.body, 3);
    pal_adaptive_update(o, &u.body);
    for (int32_t f = s->levels.first_face[3] - 1; f >= 0; f--)
        if (s->face_state[f] != PAL_FACE_SPLIT) pal_adaptive_join(o, &u.body, f);
    uint64_t revision = o->revision, shown = u.body.display.revision;
    CHECK(pal_adaptive_update(o, &u.body));
    CHECK_INT(o->revision, revision + 1);
    CHECK(u.body.display.revision > shown);
    CHECK(s->n_leaf_of[3] > 10 && s->n_leaf_of[0] > 10);
    CHECK(same_record(record_of(&t), record_of(&u)));
    give_back(&t);
    give_back(&u);
}

static void a_change_undone_before_the_update_is_none(void)
{
    thing t = make(SPHERE, (pal_adaptive_options){.n_level = 3, .start_level = 1});
    pal_adaptive_surface *s = t.adaptive;
    record before = record_of(&t);
    uint64_t revision = s->revision;
    for (int32_t f = 0; f < 20; f++) CHECK(pal_adaptive_join(s, &t.body, f));
    for (int32_t f = 0; f < 20; f++) CHECK_INT(pal_adaptive_split(s, &t.body, f, 0), 1);
    CHECK(!pal_adaptive_update(s, &t.body));
    CHECK_INT(s->revision, revision);
    CHECK(same_record(before, record_of(&t)));
    /* another state with as many leaves is one */
    CHECK(pal_adaptive_join(s, &t.body, 3));
    CHECK(pal_adaptive_update(s, &t.body));
    CHECK_INT(pal_adaptive_split(s, &t.body, 3, 0), 1);
    CHECK(pal_adaptive_join(s, &t.body, 150));
    CHECK(pal_adaptive_update(s, &t.body));
    CHECK_INT(s->revision, revision + 2);
    give_back(&t);
}

/* ---- limits ---- */

static void a_split_brings_its_coarser_neighbours(void)
{
    thing t = make(SPHERE, (pal_adaptive_options){.n_level = 4});
    pal_adaptive_surface *s = t.adaptive;
    const pal_levels *l = &s->levels;
    /* child 0 of child 0 of face 0: two of its sides are halves, their other faces are coarse */
    CHECK_INT(pal_adaptive_split(s, &t.body, 0, 0), 1);
    CHECK_INT(pal_adaptive_split(s, &t.body, 0, 0), 0);
    CHECK_INT(pal_adaptive_split(s, &t.body, pal_levels_face_child(l, 0, 0), 0), 3);
    int32_t deep = pal_levels_face_child(l, pal_levels_face_child(l, 0, 0), 0);
    CHECK(pal_adaptive_split(s, &t.body, deep, 0) >= 3);
    CHECK_INT(pal_adaptive_split(s, &t.body, pal_levels_face_child(l, deep, 0), 0), 0);
    CHECK_INT(pal_adaptive_split(s, &t.body, l->first_face[3] - 1, 0), 0);
    /* and may not be joined while finer neighbours lean on it */
    CHECK(!pal_adaptive_can_join(s, 0));
    CHECK(!pal_adaptive_can_join(s, l->edge[l->face_edge[0]].face[0] ? l->edge[l->face_edge[0]].face[0]
                                                                     : l->edge[l->face_edge[0]].face[1]));
    CHECK(pal_adaptive_join(s, &t.body, deep));
    CHECK(!pal_adaptive_join(s, &t.body, deep));
    CHECK_INT(pal_adaptive_split(s, &t.body, deep, 0), 1);
    pal_adaptive_update(s, &t.body);
    CHECK_INT(count_steep(s), 0);
    CHECK_INT(count_cracks(s), 0);
    give_back(&t);
}

static void there_are_never_more_nodes_than_allowed(void)
{
    thing t = make(SPHERE, (pal_adaptive_options){.n_level = 4});
    pal_adaptive_surface *s = t.adaptive;
    dice d = {.seed = 61};
    int max = 0, worst = 0;
    record before = record_of(&t);
    CHECK_INT(pal_adaptive_split(s, &t.body, 3, 116), 0);
    CHECK(!pal_adaptive_update(s, &t.body));
    CHECK(same_record(before, record_of(&t)));
    CHECK_INT(pal_adaptive_split(s, &t.body, 3, 117), 1);
    for (int k = 0; k < 300; k++) {
        stir(&t, &d, 5, 200);
        pal_adaptive_update(s, &t.body);
        if (s->n_node > max) max = s->n_node;
        worst += count_steep(s) + count_odd_nodes(&t);
    }
    CHECK(max > 190 && max <= 200);
    CHECK_INT(worst, 0);
    give_back(&t);
}

static void a_level_is_taken_from_any_state(void)
{
    for (int start = 0; start < 8; start++) {
        thing t = make(start & 1 ? STOMACH : SHEET, (pal_adaptive_options){.n_level = 4, .start_level = start / 2});
        pal_adaptive_surface *s = t.adaptive;
        record before = record_of(&t);
        dice d = {.seed = 71};
        CHECK_INT(s->finest, start / 2);
        CHECK_INT(s->n_leaf_of[start / 2], s->n_leaf);
        CHECK_NEAR(s->spring_ramp, 1, 0);
        CHECK_NEAR(s->shape_ramp, 1, 0);
        for (int k = 0; k < 10; k++) stir(&t, &d, 50, 0), pal_adaptive_update(s, &t.body);
        s->spring_ramp = s->shape_ramp = 0.7;
        for (int level = 0; level < 4; level++) {
            pal_adaptive_set_level(s, &t.body, level);
            pal_adaptive_update(s, &t.body);
            CHECK_INT(s->n_leaf, s->levels.first_face[1] << 2 * level);
            CHECK_INT(count_odd_nodes(&t) + count_odd_places(s), 0);
        }
        join_all(&t);
        pal_adaptive_update(s, &t.body);
        CHECK_INT(s->n_node, s->levels.n_vertex[0]);
        pal_adaptive_set_level(s, &t.body, start / 2);
        pal_adaptive_update(s, &t.body);
        CHECK_NEAR(s->spring_ramp, 1, 0);
        CHECK_NEAR(s->shape_ramp, 1, 0);
        CHECK(same_record(before, record_of(&t)));
        give_back(&t);
    }
}

/* ---- refusals ---- */

static pal_err try_make(const pal_surface *s, pal_adaptive_options o, pal_diagnostic *diag)
{
    pal_arena *arena = pal_arena_create(1 << 16, true);
    pal_body body = {0};
    pal_adaptive_surface *adaptive = NULL;
    diag->text[0] = 0;
    pal_err err = pal_adaptive_make(s, &o, &body, arena, diag, &adaptive);
    if (err && (adaptive || body.model.adaptive)) CHECK_FAIL("made although refused");
    pal_arena_destroy(arena);
    return err;
}

static void refuses_with_a_sentence_that_names_the_offender(void)
{
    const pal_adaptive_options fine = {.n_level = 2, .mass_kg = 1};
    pal_adaptive_options o;
    pal_diagnostic diag;
    pal_surface s = surface_of(SPHERE);
    o = fine, o.mass_kg = 0;
    CHECK_INT(try_make(&s, o, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "adaptive surface: a mass of 0 kg");
    o = fine, o.mass_kg = (double)NAN;
    CHECK_INT(try_make(&s, o, &diag), PAL_ERR_REFUSED);
    o = fine, o.start_level = 2;
    CHECK_INT(try_make(&s, o, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "adaptive surface: start level 2, there are levels 0 to 1");
    o = fine, o.n_level = 11;
    CHECK_INT(try_make(&s, o, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "levels: 11 levels asked for, 1 to 10 are made");
    /* the levels alone would fit */
    o = fine, o.budget_byte = (size_t)180 << 10;
    CHECK_INT(try_make(&s, o, &diag), PAL_ERR_BUDGET);
    CHECK(strstr(diag.text, "adaptive surface: 2 levels need ") && strstr(diag.text, "the budget is 0.1758 MiB"));
    o = fine, o.n_level = 10;
    CHECK_INT(try_make(&s, o, &diag), PAL_ERR_BUDGET);
    CHECK(strstr(diag.text, "levels: 10 levels need ") && strstr(diag.text, "the budget is 512 MiB"));
    /* surfaces */
    const int32_t t5[3] = {s.tri[15], s.tri[16], s.tri[17]};
    s.tri[15] = s.tri[16];
    CHECK_INT(try_make(&s, fine, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "triangle 5"));
    s.tri[15] = t5[1], s.tri[16] = t5[0];
    CHECK_INT(try_make(&s, fine, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "run the same way"));
    s.tri[15] = t5[0], s.tri[16] = t5[1];
    const double x7 = s.x[21];
    s.x[21] = (double)NAN;
    CHECK_INT(try_make(&s, fine, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "vertex 7"));
    s.x[21] = x7;
    memcpy(s.x + 3 * t5[0], s.x + 3 * t5[1], 3 * sizeof *s.x);
    CHECK_INT(try_make(&s, fine, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "has no area"));
    pal_surface_free(&s);
}

static void its_memory_is_what_it_says(void)
{
    pal_surface surface = surface_of(STOMACH);
    pal_arena *arena = pal_arena_create(1 << 10, true);
    pal_body body = {0};
    pal_adaptive_surface *s = NULL;
    pal_adaptive_options o = {.n_level = 5, .mass_kg = 1};
    REQUIRE(!pal_adaptive_make(&surface, &o, &body, arena, NULL, &s));
    double n = s->levels.n_vertex[4], summary = ceil((double)s->n_byte / n) * n;
    CHECK_LE(fabs((double)pal_arena_used(arena) / summary - 1), 0.01);
    pal_arena_destroy(arena);
    pal_surface_free(&surface);
}

int main(void)
{
    RUN(counts_of_full_refinement_are_those_of_table_1);
    RUN(every_state_is_balanced_watertight_and_of_the_same_mass);
    RUN(mixed_nodes_weigh_the_mean_of_their_springs_levels);
    RUN_LONG(a_hundred_thousand_nodes_weigh_what_they_should);
    RUN(masses_by_faces_change_only_where_faces_do);
    RUN(the_log_replays_to_the_table);
    RUN(ten_thousand_random_changes_and_back_leave_every_bit);
    RUN(the_same_state_by_another_way_has_the_same_lists);
    RUN(a_change_undone_before_the_update_is_none);
    RUN(a_split_brings_its_coarser_neighbours);
    RUN(there_are_never_more_nodes_than_allowed);
    RUN(a_level_is_taken_from_any_state);
    RUN(refuses_with_a_sentence_that_names_the_offender);
    RUN(its_memory_is_what_it_says);
    return check_report();
}
