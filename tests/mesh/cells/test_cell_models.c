/* Named solids: the control cells of Table 1 of paper A, their topology, and elements that are sound at every Gauss
 * point. */
#include "server/mesh/cells/cell_elements.h"
#include "server/mesh/cells/cell_lattice.h"
#include "server/mesh/cells/cell_models.h"
#include "server/mesh/cells/maccracken_joy.h"
#include "server/mesh/files/mesh_file.h"
#include "server/num/spline.h"
#include "tests/check.h"
#include "tests/fixtures/cell_check.h"

#include <float.h>

/* what is known of a solid; elements at the levels of Table 1 */
typedef struct known {
    const char *name;
    int n_cell, n_piece, n_cavity, genus, n_element, n_cubic, n_pyramid;
} known;

static const known list[PAL_CELL_MODELS] = {
    {"soccer", 24, 1, 0, 0, 1536, 408, 0}, {"monster", 38, 1, 0, 1, 312, 0, 16}, {"block3", 27, 1, 0, 0, 1728, 1000, 0},
    {"chair", 76, 1, 0, 5, 712, 0, 208},   {"block4", 64, 1, 0, 0, 512, 216, 0}, {"head", 123, 1, 0, 0, 1074, 144, 184},
    {"bridge", 150, 1, 0, 20, 1200, 0, 0}, {"nozzle", 99, 1, 0, 1, 792, 0, 0},   {"kidney", 83, 1, 0, 0, 664, 0, 0},
};

static pal_cells of(const char *name)
{
    pal_cells c = {0};
    pal_diagnostic diag = {"no note"};
    const pal_cell_model *model = pal_cell_model_find(name);
    if (!model || pal_cell_model_make(model, &c, &diag)) CHECK_FAIL("%s: %s", name, diag.text);
    return c;
}

static pal_subdivision refined(const pal_cells *c, int n_level, pal_subdivision_rule rule)
{
    pal_subdivision s = {0};
    pal_diagnostic diag = {"no note"};
    const pal_subdivision_options o = {.n_level = n_level, .rule = rule};
    if (pal_subdivision_make(c, &o, &s, &diag)) CHECK_FAIL("%d levels of %d cells: %s", n_level, c->n_cell, diag.text);
    return s;
}

static void control_cells_are_as_many_as_in_table_1(void)
{
    static const int table[8] = {24, 38, 27, 76, 64, 123, 150, 99};
    for (int k = 0; k < PAL_CELL_MODELS; k++) {
        pal_cells c = of(list[k].name);
        pal_diagnostic diag = {"no note"};
        CHECK_INT(c.n_cell, list[k].n_cell);
        CHECK_INT(c.n_cell, pal_cell_model_list[k].n_cell);
        CHECK_TEXT(pal_cell_model_list[k].name, list[k].name);
        if (k < 8) CHECK_INT(c.n_cell, table[k]);
        if (cells_check(&c, NULL, &diag)) CHECK_FAIL("%s: %s", list[k].name, diag.text);
        CHECK_INT(c.n_pinched_edge + c.n_pinched_vertex, 0);
        pal_cells_free(&c);
    }
    CHECK(!pal_cell_model_find("sofa") && !pal_cell_model_find(""));
}

static void pieces_hollows_and_holes_are_those_of_the_thing(void)
{
    for (int k = 0; k < PAL_CELL_MODELS; k++) {
        pal_cells c = of(list[k].name);
        pal_cells_topology t = {0};
        CHECK_INT(pal_cells_find_topology(&c, &t), PAL_ERR_OK);
        CHECK_INT(t.n_piece, list[k].n_piece);
        CHECK_INT(t.n_cavity, list[k].n_cavity);
        if (t.genus != list[k].genus) CHECK_FAIL("%s: genus %d", list[k].name, t.genus);
        CHECK_INT(t.sheet_euler, 2 * (t.n_sheet - t.genus));
        pal_cells_free(&c);
    }
}

/* gradients of all shape functions at the 64 Gauss points, points innermost */
typedef struct gradients {
    double g[PAL_CELL_MAX_NODES][3][PAL_CELL_GAUSS_POINTS], weight[PAL_CELL_GAUSS_POINTS],
        shrink[PAL_CELL_GAUSS_POINTS];
} gradients;

static void fill(gradients *to, int n_node)
{
    for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
        double at[3], g[PAL_CELL_MAX_NODES][3];
        to->weight[p] = pal_cell_gauss_point(p, at);
        pal_cell_shape(n_node, at, NULL, g);
        for (int m = 0; m < n_node; m++)
            for (int b = 0; b < 3; b++) to->g[m][b][p] = g[m][b];
        /* the base of a pyramid shrinks towards its apex, and so does its measure; its mean is 1 */
        to->shrink[p] = n_node == PAL_PYRAMID_NODES ? 3 * (1 - at[2]) * (1 - at[2]) : 1;
    }
}

/* volume of an element; its least det J against the mean */
static double element_volume(const gradients *to, const double *x, const int32_t *node, int n, double *min)
{
    double J[3][3][PAL_CELL_GAUSS_POINTS] = {{{0}}}, volume = 0, low = DBL_MAX;
    for (int m = 0; m < n; m++)
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) J[a][b][p] += x[3 * node[m] + a] * to->g[m][b][p];
    for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
        double d = J[0][0][p] * (J[1][1][p] * J[2][2][p] - J[1][2][p] * J[2][1][p]) -
                   J[0][1][p] * (J[1][0][p] * J[2][2][p] - J[1][2][p] * J[2][0][p]) +
                   J[0][2][p] * (J[1][0][p] * J[2][1][p] - J[1][1][p] * J[2][0][p]);
        volume += to->weight[p] * d;
        low = fmin(low, d / to->shrink[p]);
    }
    *min = fmin(*min, low / fabs(volume));
    return volume;
}

static double quadrature(const pal_cell_elements *e, const double *x, double *min)
{
    double sum = 0;
    static gradients to;
    *min = DBL_MAX;
    for (int kind = 0; kind < PAL_CELL_KINDS; kind++) {
        int n = pal_cell_kind_nodes((pal_cell_kind)kind);
        fill(&to, n);
        for (int32_t i = 0; i < e->n[kind]; i++)
            sum += element_volume(&to, x, e->node[kind] + (size_t)n * (size_t)i, n, min);
    }
    return sum;
}

/* hexahedra away from the boundary and from other cells, whose corners are those of eight cells each */
static int count_regular(const pal_cells *c)
{
    int n = 0;
    for (int32_t i = 0; i < c->n_cell; i++) {
        bool regular = true;
        for (int32_t k = c->cell_vertex.start[i]; k < c->cell_vertex.start[i + 1]; k++) {
            int32_t v = c->cell_vertex.item[k], first = c->vertex_cell.start[v], end = c->vertex_cell.start[v + 1];
            regular = regular && !c->vertex_boundary[v] && end - first == 8;
            for (int32_t m = first; m < end; m++) {
                int32_t cell = c->vertex_cell.item[m];
                regular = regular && c->cell_use[cell + 1] - c->cell_use[cell] == 6;
            }
        }
        n += regular;
    }
    return n;
}

static void elements_are_as_many_as_their_cells_make(void)
{
    for (int k = 0; k < PAL_CELL_MODELS; k++) {
        const pal_cell_model *model = &pal_cell_model_list[k];
        pal_cells c = of(model->name);
        pal_subdivision s = refined(&c, model->n_level, PAL_SUBDIVISION_MACCRACKEN_JOY);
        pal_cell_elements e = {0};
        REQUIRE(s.cells.n_cell > 0 && !pal_cell_elements_make(&s.cells, &e, NULL));
        /* a brick becomes 8 elements, a wedge 6, a pyramid 4 and 8 pyramids */
        int want = 0, pyramid = 0;
        for (int32_t i = 0; i < c.n_cell; i++) {
            int n_vertex = c.cell_vertex.start[i + 1] - c.cell_vertex.start[i];
            want += n_vertex == 8 ? 8 : n_vertex == 6 ? 6 : n_vertex == 5 ? 12 : -10000;
            pyramid += n_vertex == 5 ? 8 : 0;
        }
        if (model->n_level == 2) want *= 8;
        CHECK_INT(pal_cell_elements_count(&e), want);
        CHECK_INT(pal_cell_elements_count(&e), list[k].n_element);
        CHECK_INT(e.n[PAL_CELL_PYRAMID], pyramid);
        CHECK_INT(e.n[PAL_CELL_PYRAMID], list[k].n_pyramid);
        CHECK_INT(e.n[PAL_CELL_CUBIC], list[k].n_cubic);
        CHECK_INT(e.n[PAL_CELL_CUBIC], count_regular(&s.cells));
        /* the share of pyramids is the paper's within what the count of cells allows */
        if (model->n_element)
            CHECK_NEAR(pal_cell_elements_percent(&e, PAL_CELL_PYRAMID), model->percent[PAL_CELL_PYRAMID], 1.2);
        pal_cell_elements_free(&e);
        pal_subdivision_free(&s);
        pal_cells_free(&c);
    }
}

static double *places(const pal_cell_elements *e, const pal_subdivision *s, const double *p)
{
    pal_interpolation rows = {0};
    double *d = malloc((size_t)(e->n_vertex + e->n_virtual) * 3 * sizeof *d);
    if (!d || pal_cell_elements_interpolation(e, &s->rows, &rows)) abort();
    pal_interpolation_apply(&rows, p, d);
    pal_interpolation_free(&rows);
    return d;
}

static void sound_with(const char *name, int n_level, pal_subdivision_rule rule)
{
    pal_cells c = of(name);
    pal_subdivision s = refined(&c, n_level, rule);
    pal_cell_elements e = {0};
    pal_diagnostic diag = {"no note"};
    double low;
    REQUIRE(s.cells.n_cell > 0);
    if (pal_cell_elements_make(&s.cells, &e, &diag)) CHECK_FAIL("%s: %s", name, diag.text);
    double *x = places(&e, &s, c.x);
    double volume = quadrature(&e, x, &low);
    if (!(low > 0)) CHECK_FAIL("%s at level %d: det J is %g of the element's mean", name, n_level, low);
    CHECK(volume > 0 && volume < pal_cells_volume(&c, NULL));
    free(x);
    pal_cell_elements_free(&e);
    pal_subdivision_free(&s);
    pal_cells_free(&c);
}

static void every_element_has_positive_measure_at_64_points_at_levels_1_to_3(void)
{
    for (int k = 0; k < PAL_CELL_MODELS; k++)
        for (int n = 1; n <= CHECK_REPEATS(3, 1); n++) sound_with(list[k].name, n, PAL_SUBDIVISION_MACCRACKEN_JOY);
}

static void averaging_keeps_them_sound_too(void)
{
    for (int k = 0; k < PAL_CELL_MODELS; k++) sound_with(list[k].name, 2, PAL_SUBDIVISION_AVERAGING);
}

static void place_as_it_is(const double at[3], double x[3])
{
    for (int a = 0; a < 3; a++) x[a] = at[a];
}

static void letters_of_a_lattice_are_bricks_pyramids_and_wedges(void)
{
    static const char letter[] = "#XEWNSUDabcdefghijkl";
    for (const char *at = letter; *at; at++) {
        const char rows[2] = {*at, 0};
        const pal_cell_lattice lattice = {.n = {1, 1, 1}, .rows = rows, .place = place_as_it_is};
        pal_cells c = {0};
        pal_diagnostic diag = {"no note"};
        if (pal_cell_lattice_make(&lattice, &c, &diag)) CHECK_FAIL("%c: %s", *at, diag.text);
        double want = *at == '#' || *at == 'X' ? 1 : *at >= 'a' ? 1.0 / 2 : 1.0 / 3;
        CHECK_NEAR(pal_cells_volume(&c, NULL), want, 1e-15);
        CHECK_INT(c.n_cell, *at == 'X' ? 6 : 1);
        CHECK_INT(c.n_vertex, *at == '#' ? 8 : *at == 'X' ? 9 : *at >= 'a' ? 6 : 5);
        /* it fills its place from side to side; the apex stands alone, the edge is gone */
        double low[3] = {1, 1, 1}, high[3] = {0, 0, 0};
        for (int i = 0; i < 3 * c.n_vertex; i++)
            low[i % 3] = fmin(low[i % 3], c.x[i]), high[i % 3] = fmax(high[i % 3], c.x[i]);
        CHECK(low[0] + low[1] + low[2] == 0 && high[0] + high[1] + high[2] == 3);
        const char *side = strchr("WESNDU", *at);
        if (side) {
            int axis = (int)(side - "WESNDU") / 2, n_there = 0;
            for (int v = 0; v < c.n_vertex; v++) n_there += c.x[3 * v + axis] == (double)((side - "WESNDU") % 2);
            CHECK_INT(n_there, 1);
        }
        if (*at >= 'a') {
            int axis = (*at - 'a') / 4, bit = (*at - 'a') % 4, n_there = 0;
            for (int v = 0; v < c.n_vertex; v++)
                n_there += c.x[3 * v + (axis + 1) % 3] == (bit & 1) && c.x[3 * v + (axis + 2) % 3] == bit >> 1;
            CHECK_INT(n_there, 0);
        }
        pal_cells_free(&c);
    }
    const pal_cell_lattice lattice = {.n = {2, 1, 1}, .rows = "#?", .place = place_as_it_is};
    pal_cells c = {0};
    pal_diagnostic diag = {""};
    CHECK_INT(pal_cell_lattice_make(&lattice, &c, &diag), PAL_ERR_INTERNAL);
    CHECK_TEXT(diag.text, "cells: a lattice has the letter \"?\"");
}

/* V - E + F of a closed surface is 2 - 2 genus; files give positions back as their numbers allow */
static void boundaries_read_back_closed_with_their_genus(void)
{
    static const char *const end[3] = {"ply", "obj", "stl"};
    static const struct {
        const char *name;
        int genus;
    } thing[3] = {{"chair", 5}, {"monster", 1}, {"nozzle", 1}};
    char path[64];
    for (int k = 0; k < 9; k++) {
        pal_cells c = of(thing[k / 3].name);
        pal_surface out = {0}, in = {0};
        pal_surface_report report = {.n_tri_read = 0};
        pal_surface_topology topology;
        const pal_mesh_file_options metres = {.unit_m = 1};
        snprintf(path, sizeof path, "test_cell_models_%ld.%s", (long)getpid(), end[k % 3]);
        CHECK_INT(pal_cells_boundary(&c, &out, NULL, NULL), PAL_ERR_OK);
        CHECK_INT(pal_mesh_file_write(path, &out, NULL), PAL_ERR_OK);
        CHECK_INT(pal_mesh_file_read(path, &metres, &in, &report, NULL, NULL, NULL), PAL_ERR_OK);
        CHECK_INT(pal_surface_check(&in, &topology), PAL_ERR_OK);
        CHECK(topology.closed && topology.manifold && topology.oriented);
        CHECK_INT(in.n_tri, out.n_tri);
        CHECK_INT(in.n_vertex - in.n_tri / 2, 2 - 2 * thing[k / 3].genus);
        CHECK_NEAR(pal_surface_volume(&in) / pal_surface_volume(&out), 1, k % 3 == 1 ? 1e-13 : 1e-6);
        remove(path);
        pal_surface_free(&in);
        pal_surface_free(&out);
        pal_cells_free(&c);
    }
    pal_diagnostic diag = {""};
    CHECK_INT(pal_mesh_file_write("chair.off", &(pal_surface){0}, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "chair.off: surfaces are written to .ply, .obj or .stl files");
}

int main(void)
{
    RUN(letters_of_a_lattice_are_bricks_pyramids_and_wedges);
    RUN(control_cells_are_as_many_as_in_table_1);
    RUN(pieces_hollows_and_holes_are_those_of_the_thing);
    RUN(elements_are_as_many_as_their_cells_make);
    RUN(every_element_has_positive_measure_at_64_points_at_levels_1_to_3);
    RUN_LONG(averaging_keeps_them_sound_too);
    RUN(boundaries_read_back_closed_with_their_genus);
    return check_report();
}
