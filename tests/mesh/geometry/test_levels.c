/* Detail levels: counts, family tree, winged edges, memory, refusals. */
#include "server/mesh/files/mesh_file.h"
#include "server/mesh/geometry/levels.h"
#include "server/mesh/geometry/procedural.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/shapes.h"
#include "tests/stability/hard_case.h"

#include <time.h>

static pal_levels levels_of(pal_surface s, int n_level)
{
    pal_levels l = {0};
    pal_diagnostic diag = {.text = "no note"};
    pal_levels_options options = {.n_level = n_level};
    if (pal_levels_make(&s, &options, &l, &diag)) CHECK_FAIL("%s", diag.text);
    pal_surface_free(&s);
    return l;
}

static pal_surface sheet(int n, int m)
{
    pal_surface s = {0};
    if (pal_sheet_make(n, m, 0.1 * (n - 1), 0.1 * (m - 1), &s, NULL)) CHECK_FAIL("no sheet");
    return s;
}

/* made once, a copy each time */
static pal_surface stomach(void)
{
    static pal_stomach made;
    pal_surface s = {0};
    if (!made.surface.x && pal_stomach_make(&made)) CHECK_FAIL("no stomach");
    if (pal_surface_copy(&made.surface, &s)) CHECK_FAIL("no copy");
    return s;
}

static pal_surface open_ball(void)
{
    pal_surface s = shape_ball(1, 9, 7, 0.1);
    pal_surface_report report = {0};
    shape_cut(&s, 0.4);
    if (pal_surface_clean(&s, 0, &report, NULL)) CHECK_FAIL("no ball");
    return s;
}

/* the surfaces that every invariant is asked of; NULL ends the list */
static bool example(int k, pal_surface *s, const char **name)
{
    static const char *const names[] = {"tetrahedron", "octahedron", "box",          "torus",     "stomach",
                                        "sheet",       "open ball",  "one triangle", "two bodies"};
    if (k >= (int)(sizeof names / sizeof *names)) return false;
    *name = names[k];
    switch (k) {
    case 0: {
        static const int32_t TRI[12] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
        static const double X[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
        *s = shape_room(4, 4);
        memcpy(s->tri, TRI, sizeof TRI);
        memcpy(s->x, X, sizeof X);
        break;
    }
    case 1:
        *s = shape_octahedron(1);
        break;
    case 2:
        *s = shape_cube(1);
        break;
    case 3:
        *s = shape_torus(1, 0.3, 7, 5);
        break;
    case 4:
        *s = stomach();
        break;
    case 5:
        *s = sheet(5, 4);
        break;
    case 6:
        *s = open_ball();
        break;
    case 7: {
        *s = sheet(2, 2);
        s->n_tri = 1;
        s->tri[1] = 1, s->tri[2] = 2, s->n_vertex = 3;
        break;
    }
    default: {
        pal_surface other = shape_octahedron(0.5);
        shape_move(&other, 3, 0, 0);
        *s = shape_join(shape_cube(1), other);
    }
    }
    return true;
}

static void counts_equal_the_papers(void)
{
    static const struct {
        const char *path;
        int n_vertex, n_edge, refined_vertex, refined_edge;
    } wanted[] = {{"data/sphere_114.obj", 114, 336, 450, 1344},
                  {"data/stomach_188.obj", 188, 558, 746, 2232},
                  {NULL, 114, 336, 450, 1344},
                  {NULL, 188, 558, 746, 2232}};
    for (int k = 0; k < 4; k++) {
        pal_surface s;
        pal_diagnostic diag = {.text = "no note"};
        if (wanted[k].path) {
            const char *path = check_shared(wanted[k].path);
            if (!path) continue;
            pal_mesh_file_options in = {.unit_m = 0.001, .weld = PAL_MESH_WELD};
            if (pal_mesh_file_read(path, &in, &s, NULL, NULL, NULL, &diag)) {
                CHECK_FAIL("%s", diag.text);
                continue;
            }
        } else if (k == 2)
            REQUIRE(!pal_sphere_make(0.05, &s));
        else
            s = stomach();
        pal_levels l = levels_of(s, 3);
        REQUIRE(l.n_level == 3);
        CHECK_INT(l.n_vertex[0], wanted[k].n_vertex);
        CHECK_INT(pal_levels_n_edge(&l, 0), wanted[k].n_edge);
        CHECK_INT(l.n_vertex[1], wanted[k].refined_vertex);
        CHECK_INT(pal_levels_n_edge(&l, 1), wanted[k].refined_edge);
        CHECK_INT(l.n_vertex[2], wanted[k].refined_vertex + wanted[k].refined_edge);
        CHECK_INT(pal_levels_n_edge(&l, 2), 4 * wanted[k].refined_edge);
        CHECK(l.closed);
        CHECK_INT(l.n_component, 1);
        pal_levels_free(&l);
    }
}

static void counts_follow_the_split_on_every_surface(void)
{
    pal_surface s;
    const char *name;
    for (int k = 0; example(k, &s, &name); k++) {
        pal_levels l = levels_of(s, 4);
        int euler = 0;
        for (int i = 0; i < l.n_level; i++) {
            int v = l.n_vertex[i], e = pal_levels_n_edge(&l, i), f = pal_levels_n_face(&l, i);
            if (i == 0) euler = v - e + f;
            CHECK_INT(v - e + f, euler);
            if (l.closed) CHECK_INT(2 * e, 3 * f);
            if (i + 1 == l.n_level) break;
            CHECK_INT(l.n_vertex[i + 1], v + e);
            CHECK_INT(pal_levels_n_edge(&l, i + 1), 2 * e + 3 * f);
            CHECK_INT(pal_levels_n_face(&l, i + 1), 4 * f);
        }
        int want = !strcmp(name, "torus") ? 0 : !strcmp(name, "two bodies") ? 4 : l.closed ? 2 : 1;
        CHECK_INT(euler, want);
        CHECK_INT(l.n_component, !strcmp(name, "two bodies") ? 2 : 1);
        pal_levels_free(&l);
    }
}

/* faults of one level's winged edges */
static int wing_faults(const pal_levels *l, int level)
{
    int faults = 0;
    int32_t e0 = l->first_edge[level], e1 = l->first_edge[level + 1];
    for (int32_t e = e0; e < e1; e++) {
        const pal_winged_edge *w = &l->edge[e];
        faults += w->vertex[0] == w->vertex[1] || w->face[0] < 0 || l->edge_level[e] != level;
        faults += w->vertex[0] >= l->n_vertex[level] || w->vertex[1] >= l->n_vertex[level];
        for (int side = 0; side < 2; side++) {
            int32_t f = w->face[side], n = w->next[side], p = w->prev[side];
            if (n < e0 || n >= e1 || p < e0 || p >= e1) return faults + 1000;
            /* the walk arrives where the next edge leaves, on the same face; back is where it came from */
            int32_t end = w->vertex[1 - side], start = w->vertex[side];
            int sn = pal_wing_side(l->edge, n, end), sp = 1 - pal_wing_side(l->edge, p, start);
            faults += l->edge[n].face[sn] != f || l->edge[n].vertex[sn] != end;
            faults += l->edge[p].face[sp] != f || l->edge[p].vertex[1 - sp] != start;
            faults += l->edge[n].prev[sn] != e || l->edge[p].next[sp] != e;
            if (f < 0) continue;
            /* the face has this edge from start to end */
            int k = 0;
            while (k < 3 && l->face_edge[3 * f + k] != e) k++;
            faults += k == 3 || l->face[3 * f + k % 3] != start || l->face[3 * f + (k + 1) % 3] != end;
        }
    }
    return faults;
}

static void winged_edges_undo_each_other_on_every_level(void)
{
    pal_surface s;
    const char *name;
    for (int k = 0; example(k, &s, &name); k++) {
        pal_levels l = levels_of(s, 4);
        for (int i = 0; i < l.n_level; i++) {
            int faults = wing_faults(&l, i);
            CHECK_INT(faults, 0);
            if (faults) printf("  %s, level %d\n", name, i);
        }
        pal_levels_free(&l);
    }
}

static void spokes_reach_every_face_of_a_vertex(void)
{
    pal_surface s;
    const char *name;
    for (int k = 0; example(k, &s, &name); k++) {
        pal_levels l = levels_of(s, 3);
        for (int level = 0; level < 3; level++) {
            int32_t f0 = l.first_face[level], f1 = l.first_face[level + 1];
            int32_t *count = calloc((size_t)l.n_vertex[level], sizeof *count);
            REQUIRE(count);
            for (int32_t c = 3 * f0; c < 3 * f1; c++) count[l.face[c]]++;
            int faults = 0;
            for (int32_t v = 0; v < l.n_vertex[level]; v++) {
                int32_t first = pal_levels_spoke(&l, level, v), e = first;
                int n_face = 0, n_edge = 0, last_hole = 0;
                do {
                    int32_t f = pal_wing_face(l.edge, e, v);
                    faults += l.edge[e].vertex[0] != v && l.edge[e].vertex[1] != v;
                    faults += f >= 0 && (f < f0 || f >= f1);
                    n_face += f >= 0, n_edge++, last_hole = f < 0;
                    e = pal_wing_next_around(l.edge, e, v);
                } while (e != first && n_edge < 100);
                faults +=
                    n_face != count[v] || last_hole != pal_levels_on_boundary(&l, v) || n_edge != n_face + last_hole;
                /* what subdivision adds is regular */
                if (l.vertex_level[v] > 0) faults += n_face != (last_hole ? 3 : 6);
            }
            CHECK_INT(faults, 0);
            free(count);
        }
        pal_levels_free(&l);
    }
}

/* the face that e is an inner edge of; -1: of level 0, or half of an edge */
static int32_t parent_face(const pal_levels *l, int32_t e)
{
    int level = l->edge_level[e];
    int32_t i = level ? e - l->first_edge[level] - 2 * pal_levels_n_edge(l, level - 1) : -1;
    return i >= 0 ? l->first_face[level - 1] + i / 3 : -1;
}

static void children_and_parents_agree(void)
{
    pal_surface s;
    const char *name;
    for (int k = 0; example(k, &s, &name); k++) {
        pal_levels l = levels_of(s, 4);
        int faults = 0;
        for (int32_t e = 0; e < l.first_edge[l.n_level]; e++) {
            int32_t m = pal_levels_edge_midpoint(&l, e), p = pal_levels_edge_parent(&l, e);
            int32_t pf = parent_face(&l, e);
            int level = l.edge_level[e];
            faults += level == 0 ? p >= 0 || pf >= 0 : (p < 0) == (pf < 0);
            if (p >= 0) faults += pal_levels_edge_half(&l, p, 0) != e && pal_levels_edge_half(&l, p, 1) != e;
            if (pf >= 0) {
                int i = 0;
                while (i < 3 && pal_levels_face_inner_edge(&l, pf, i) != e) i++;
                faults += i == 3 || l.edge[e].face[0] != pal_levels_face_child(&l, pf, 3) ||
                          l.edge[e].face[1] != pal_levels_face_child(&l, pf, i);
            }
            if (level + 1 == l.n_level) {
                faults += m != -1 || pal_levels_edge_half(&l, e, 0) != -1;
                continue;
            }
            const pal_winged_edge *w = &l.edge[e], *a = &l.edge[pal_levels_edge_half(&l, e, 0)], *b = a + 1;
            faults += l.vertex_level[m] != level + 1 || pal_levels_vertex_parent(&l, m) != e;
            faults +=
                a->vertex[0] != w->vertex[0] || a->vertex[1] != m || b->vertex[0] != m || b->vertex[1] != w->vertex[1];
            for (int side = 0; side < 2; side++) {
                faults +=
                    a->face[side] < 0 ? w->face[side] >= 0 : pal_levels_face_parent(&l, a->face[side]) != w->face[side];
                faults +=
                    b->face[side] < 0 ? w->face[side] >= 0 : pal_levels_face_parent(&l, b->face[side]) != w->face[side];
            }
        }
        for (int32_t f = 0; f < l.first_face[l.n_level]; f++) {
            if (l.face_level[f] + 1 == l.n_level) {
                faults += pal_levels_face_child(&l, f, 0) != -1;
                continue;
            }
            for (int c = 0; c < 4; c++) {
                int32_t child = pal_levels_face_child(&l, f, c);
                faults += pal_levels_face_parent(&l, child) != f || l.face_level[child] != l.face_level[f] + 1;
                for (int i = 0; i < 3; i++) {
                    int32_t want = c == i ? l.face[3 * f + i]
                                   : c == 3 || i == (c + 1) % 3
                                       ? pal_levels_edge_midpoint(&l, l.face_edge[3 * f + (c == 3 ? i : c)])
                                       : pal_levels_edge_midpoint(&l, l.face_edge[3 * f + (c + 2) % 3]);
                    faults += l.face[3 * child + i] != want;
                }
            }
        }
        CHECK_INT(faults, 0);
        if (faults) printf("  %s\n", name);
        pal_levels_free(&l);
    }
}

/* area of a face seen along z */
static double area_of(const pal_levels *l, int32_t f)
{
    const double *a = l->x + 3 * l->face[3 * f], *b = l->x + 3 * l->face[3 * f + 1], *c = l->x + 3 * l->face[3 * f + 2];
    return ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2;
}

static void children_cover_their_parent(void)
{
    pal_levels l = levels_of(sheet(6, 5), 4);
    double worst = 0;
    for (int32_t f = 0; f < l.first_face[3]; f++) {
        double sum = 0, whole = area_of(&l, f);
        for (int c = 0; c < 4; c++) {
            double part = area_of(&l, pal_levels_face_child(&l, f, c));
            worst = fmax(worst, fabs(part / whole - 0.25));
            sum += part;
        }
        worst = fmax(worst, fabs(sum / whole - 1));
    }
    CHECK_LE(worst, 1e-12);
    pal_levels_free(&l);
    /* on a sphere, volumes come nearer to the ball's from below, and areas */
    pal_surface s;
    REQUIRE(!pal_sphere_make(1, &s));
    l = levels_of(s, 4);
    double last = 0;
    for (int i = 0; i < 4; i++) {
        pal_surface level;
        REQUIRE(!pal_levels_surface(&l, i, &level));
        pal_surface_topology topology;
        CHECK(!pal_surface_check(&level, &topology) && topology.closed && topology.manifold && topology.oriented);
        double volume = pal_surface_volume(&level);
        CHECK(volume > last);
        last = volume;
        pal_surface_free(&level);
    }
    printf("  sphere of 114 vertices, three levels on: %.4f of the ball's volume\n", last / (4 * SHAPE_PI / 3));
    CHECK_NEAR(last, 4 * SHAPE_PI / 3, 0.02 * 4 * SHAPE_PI / 3);
    pal_levels_free(&l);
}

static void coarse_levels_are_the_surface_and_the_start_of_finer_ones(void)
{
    pal_surface s = stomach();
    s.origin_m[1] = 2.5;
    pal_levels two, four;
    pal_levels_options options = {.n_level = 2};
    REQUIRE(!pal_levels_make(&s, &options, &two, NULL));
    options.n_level = 4;
    REQUIRE(!pal_levels_make(&s, &options, &four, NULL));
    CHECK(!memcmp(four.x, s.x, 3 * (size_t)s.n_vertex * sizeof *s.x));
    CHECK(!memcmp(four.face, s.tri, 3 * (size_t)s.n_tri * sizeof *s.tri));
    CHECK(!memcmp(four.x, two.x, 3 * (size_t)two.n_vertex[1] * sizeof *two.x));
    CHECK(!memcmp(four.edge, two.edge, (size_t)two.first_edge[2] * sizeof *two.edge));
    CHECK_NEAR(four.origin_m[1], 2.5, 0);
    /* the stencils at work: at rest they give back the rest; moved rigidly, the moved rest */
    double *x = malloc((size_t)four.n_vertex[3] * 3 * sizeof *x), worst = 0;
    REQUIRE(x);
    for (int pass = 0; pass < 2; pass++) {
        double c = pass ? cos(0.7) : 1, d = pass ? sin(0.7) : 0;
        for (int32_t v = 0; v < four.n_vertex[3]; v++) {
            double *p = x + 3 * v, *r = four.x + 3 * v,
                   q[3] = {c * r[0] - d * r[1] + pass, d * r[0] + c * r[1], r[2] - pass};
            if (v < four.n_vertex[0])
                memcpy(p, q, sizeof q);
            else
                pal_levels_midpoint(&four, v, x, p);
            for (int k = 0; k < 3; k++) worst = fmax(worst, fabs(p[k] - q[k]));
        }
        if (pass == 0) CHECK_NEAR(worst, 0, 0);
    }
    CHECK_LE(worst, 1e-14);
    free(x);
    pal_levels_free(&two);
    pal_levels_free(&four);
    pal_surface_free(&s);
}

static size_t array_bytes(const pal_levels *l)
{
    size_t v = (size_t)l->n_vertex[l->n_level - 1], v0 = (size_t)l->n_vertex[0], e = (size_t)l->first_edge[l->n_level];
    size_t f = (size_t)l->first_face[l->n_level], n = (size_t)l->stencil_start[v - v0];
    return 24 * v + 32 * e + 24 * f + v + e + f + 4 * (size_t)l->first_spoke[l->n_level] + 4 * (v - v0 + 1) + 12 * n +
           v0;
}

static void memory_is_as_stated(void)
{
    pal_surface s;
    REQUIRE(!pal_sphere_make(0.1, &s));
    struct timespec from, to;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &from);
    pal_levels l = levels_of(s, 6);
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &to);
    double ms = (double)(to.tv_sec - from.tv_sec) * 1e3 + (double)(to.tv_nsec - from.tv_nsec) * 1e-6;
    double each = (double)l.n_byte / l.n_vertex[5];
    printf(
        "  %d vertices, %d edges, %d faces on the finest of 6 levels: %.0f ms of CPU, %.1f MiB, %.1f bytes a vertex\n",
        l.n_vertex[5], pal_levels_n_edge(&l, 5), pal_levels_n_face(&l, 5), ms, (double)l.n_byte / 1048576, each);
    CHECK_INT(l.n_vertex[5], 112 * 1024 + 2);
    CHECK_INT(l.n_byte, array_bytes(&l));
    CHECK_LE(each, 330);
    CHECK(each > 300);
    pal_levels_free(&l);
}

static pal_err make_with(const pal_surface *s, int n_level, size_t budget, pal_diagnostic *diag)
{
    pal_levels l = {0};
    pal_levels_options options = {.n_level = n_level, .budget_byte = budget};
    snprintf(diag->text, sizeof diag->text, "none");
    pal_err err = pal_levels_make(s, &options, &l, diag);
    if (!err) pal_levels_free(&l);
    return err;
}

static void a_budget_is_kept(void)
{
    pal_surface s = stomach(), hub;
    pal_diagnostic diag;
    CHECK_INT(make_with(&s, 3, 1000, &diag), PAL_ERR_BUDGET);
    CHECK(strstr(diag.text, "3 levels need") && strstr(diag.text, "MiB"));
    CHECK_INT(make_with(&s, 3, (size_t)4 << 20, &diag), PAL_ERR_OK);
    CHECK_INT(make_with(&s, 10, 0, &diag), PAL_ERR_BUDGET);
    CHECK(strstr(diag.text, "10 levels need") && strstr(diag.text, "the budget is 512 MiB"));
    printf("  %s\n", diag.text);
    CHECK_INT(make_with(&s, 11, 0, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "11 levels"));
    CHECK_INT(make_with(&s, 0, 0, &diag), PAL_ERR_REFUSED);
    CHECK_INT(make_with(&s, -3, 0, &diag), PAL_ERR_REFUSED);
    pal_surface_free(&s);
    /* a hub of 20 000 faces would have stencils of 20 000 squared entries */
    hub = shape_ball(1, 20000, 2, 0);
    CHECK_INT(make_with(&hub, 2, 0, &diag), PAL_ERR_BUDGET);
    CHECK_INT(make_with(&hub, 1, 0, &diag), PAL_ERR_OK);
    pal_surface_free(&hub);
}

static void refused(pal_surface s, const char *word)
{
    pal_diagnostic diag;
    const bool named = make_with(&s, 3, 0, &diag) == PAL_ERR_REFUSED && strstr(diag.text, word);
    HARD_CASE_ALL("broken_surface", "adaptive_springs", "no manifold, turned over, flat, NaN: refused by number", named,
                  1);
    if (!named) printf("  \"%s\" lacks \"%s\"\n", diag.text, word);
    pal_surface_free(&s);
}

static void broken_surfaces_are_refused_with_a_sentence(void)
{
    /* three faces on an edge: a fin on a cube */
    pal_surface s = shape_room(9, 13), cube = shape_cube(1);
    memcpy(s.x, cube.x, 24 * sizeof *s.x), memcpy(s.tri, cube.tri, 36 * sizeof *s.tri);
    s.x[24] = 2, s.x[25] = 2, s.x[26] = 0;
    s.tri[36] = cube.tri[0], s.tri[37] = cube.tri[1], s.tri[38] = 8;
    refused(s, "prepare it as voxels: palpate prepare");
    pal_surface_free(&cube);
    /* two tents that touch in a vertex: open, then closed */
    s = shape_join(sheet(2, 2), sheet(2, 2));
    for (int i = 6; i < 12; i++) s.tri[i] = s.tri[i] == 4 ? 3 : s.tri[i] - (s.tri[i] > 4);
    memmove(s.x + 12, s.x + 15, 9 * sizeof *s.x);
    s.n_vertex = 7;
    for (int v = 4; v < 7; v++) s.x[3 * v] += 0.1, s.x[3 * v + 1] += 0.1;
    refused(s, "touch in vertex 3");
    s = shape_join(shape_octahedron(1), shape_octahedron(1));
    shape_move(&s, 0, 0, 0);
    for (int i = 24; i < 48; i++) s.tri[i] = s.tri[i] == 6 ? 1 : s.tri[i] - (s.tri[i] > 6);
    memmove(s.x + 18, s.x + 21, 15 * sizeof *s.x);
    s.n_vertex = 11;
    for (int v = 6; v < 11; v++) s.x[3 * v] += 2;
    refused(s, "touch in vertex 1");
    s = shape_cube(1);
    int32_t turn = s.tri[3];
    s.tri[3] = s.tri[4], s.tri[4] = turn;
    refused(s, "run the same way");
    s = shape_cube(1);
    s.tri[5] = 8;
    refused(s, "triangle 1 has vertex 8, there are 8");
    s = shape_cube(1);
    s.tri[5] = -1;
    refused(s, "has vertex -1");
    s = shape_cube(1);
    s.tri[7] = s.tri[6];
    refused(s, "twice");
    s = shape_cube(1);
    s.x[4] = NAN;
    refused(s, "vertex 1 stands at");
    s = shape_cube(1);
    s.x[4] = 1e300;
    refused(s, "vertex 1 stands at");
    s = sheet(3, 2);
    s.x[3] = s.x[0], s.x[4] = s.x[1];
    refused(s, "no area");
    s = shape_join(shape_cube(1), shape_cube(1));
    s.n_tri = 12;
    refused(s, "vertex 8 belongs to no triangle");
    s = shape_room(3, 2);
    int32_t pillow[6] = {0, 1, 2, 0, 2, 1};
    double x[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    memcpy(s.tri, pillow, sizeof pillow), memcpy(s.x, x, sizeof x);
    refused(s, "same corners");
    s = shape_cube(1);
    s.n_tri = 0;
    refused(s, "0 triangles");
    /* a Moebius band cannot be run through one way */
    s = shape_room(10, 10);
    for (int i = 0; i < 5; i++) {
        double a = 2 * SHAPE_PI * i / 5, w = 0.3;
        for (int k = 0; k < 2; k++) {
            double r = 1 + (k ? w : -w) * cos(a / 2), *p = s.x + 3 * (2 * i + k);
            p[0] = r * cos(a), p[1] = r * sin(a), p[2] = (k ? w : -w) * sin(a / 2);
        }
        int32_t p = 2 * i, q = p + 1, u = i == 4 ? 1 : p + 2, v = i == 4 ? 0 : p + 3, two[6] = {p, u, q, q, u, v};
        memcpy(s.tri + 6 * i, two, sizeof two);
    }
    refused(s, "run the same way");
}

/* random triangles, and good surfaces with random damage: an answer, a sentence when refused, sound levels when not */
static void any_input_is_accepted_or_refused(void)
{
    uint64_t seed = 20;
    int n_ok = 0, n_refused = 0;
    for (int round = 0; round < CHECK_REPEATS(3000, 600); round++) {
        pal_surface s;
        const char *name = "random";
        if (round % 2)
            example((int)(random_below(&seed, 9)), &s, &name);
        else {
            s = shape_room(3 + (int)(random_below(&seed, 6)), 1 + (int)(random_below(&seed, 10)));
            for (int i = 0; i < 3 * s.n_vertex; i++) s.x[i] = random_signed(&seed);
            for (int i = 0; i < 3 * s.n_tri; i++) s.tri[i] = (int32_t)(random_below(&seed, (uint64_t)s.n_vertex));
        }
        for (int k = (int)(random_below(&seed, 4)); round % 2 && k > 0; k--) {
            int32_t *at = &s.tri[random_below(&seed, (3 * (uint64_t)s.n_tri))];
            double *x = &s.x[random_below(&seed, (3 * (uint64_t)s.n_vertex))];
            switch (random_below(&seed, 6)) {
            case 0:
                *at = (int32_t)(random_below(&seed, (uint64_t)s.n_vertex));
                break;
            case 1:
                *at = (int32_t)(random_bits(&seed) >> 33) - 1000;
                break;
            case 2:
                *x = random_below(&seed, 2) ? NAN : INFINITY;
                break;
            case 3:
                *x = ldexp(random_signed(&seed), (int)(random_below(&seed, 2000)) - 1000);
                break;
            case 4:
                s.n_tri -= s.n_tri > 1;
                break;
            default:
                *x = 0;
            }
        }
        pal_levels l = {0};
        pal_diagnostic diag = {.text = ""};
        pal_levels_options options = {.n_level = 3};
        pal_err err = pal_levels_make(&s, &options, &l, &diag);
        if (err) {
            n_refused++;
            CHECK(err == PAL_ERR_REFUSED && !strncmp(diag.text, "levels: ", 8) && l.x == NULL);
        } else {
            n_ok++;
            CHECK_INT(wing_faults(&l, 2), 0);
            pal_levels_free(&l);
        }
        pal_surface_free(&s);
    }
    printf("  %d surfaces made, %d refused\n", n_ok, n_refused);
    CHECK(n_ok > 100 && n_refused > 100);
}

int main(void)
{
    RUN(counts_equal_the_papers);
    RUN(counts_follow_the_split_on_every_surface);
    RUN(winged_edges_undo_each_other_on_every_level);
    RUN(spokes_reach_every_face_of_a_vertex);
    RUN(children_and_parents_agree);
    RUN(children_cover_their_parent);
    RUN(coarse_levels_are_the_surface_and_the_start_of_finer_ones);
    RUN(memory_is_as_stated);
    RUN(a_budget_is_kept);
    RUN(broken_surfaces_are_refused_with_a_sentence);
    RUN(any_input_is_accepted_or_refused);
    return check_report();
}
