/* `palpate cells`: control cells of a primitive, of a named solid or of a file, subdivided and written as cells or as
 * their boundary, with the figures of paper A, Table 1. */
#include "server/cli/report.h"
#include "server/commands/commands.h"
#include "server/mesh/cells/cell_elements.h"
#include "server/mesh/cells/cell_file.h"
#include "server/mesh/cells/cell_models.h"
#include "server/mesh/cells/cell_shapes.h"
#include "server/mesh/cells/maccracken_joy.h"
#include "server/mesh/files/mesh_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char about[] =
    "Makes the control cells of a subdivision solid (paper A), subdivides them and writes them to a file. SHAPE\n"
    "is a primitive: block, ring, tube or torus; a named solid: soccer, monster, block3, chair, block4, head,\n"
    "bridge, nozzle or kidney; or a file of cells, .palcells or .vtk. FILE.palcells and FILE.vtk receive the\n"
    "cells, FILE.ply, .obj and .stl the boundary. Without -o only the figures are printed.\n";

typedef struct arguments {
    const char *file, *rule, *cells, *size;
    int n_level;
    bool list;
} arguments;

typedef struct outcome {
    char name[128];
    const pal_cell_model *model; /* NULL: another shape */
    pal_cells control;
    pal_subdivision made;
    bool has_elements; /* false: cells that are no hexahedra, before the first level */
    pal_cell_elements elements;
    pal_cells_topology topology;
    double control_m3, volume_m3, size_m[3];
    int n_boundary_vertex, n_triangle;
} outcome;

static void free_outcome(outcome *o)
{
    pal_cells_free(&o->control);
    pal_subdivision_free(&o->made);
    pal_cell_elements_free(&o->elements);
}

/* a primitive: what its numbers of cells and its sizes mean, and their defaults */
typedef struct primitive {
    const char *name, *cells_are, *sizes_are;
    int n_count, n_size;
    double count[3], size_m[3];
} primitive;

static const primitive primitive_list[] = {
    {"block", "along x, y and z", "along x, y and z", 3, 3, {3, 3, 3}, {0.1, 0.1, 0.1}},
    {"ring", "around", "radius and thickness", 1, 2, {8}, {0.05, 0.02}},
    {"tube",
     "around, through the wall and along",
     "inner radius, outer radius and length",
     3,
     3,
     {8, 1, 4},
     {0.02, 0.03, 0.1}},
    {"torus", "around and across the middle", "radius and radius of the tube", 2, 2, {8, 1}, {0.05, 0.02}},
};
enum { N_PRIMITIVE = sizeof primitive_list / sizeof primitive_list[0] };

static const primitive *find_primitive(const char *name)
{
    for (int k = 0; k < N_PRIMITIVE; k++)
        if (!strcmp(name, primitive_list[k].name)) return &primitive_list[k];
    return NULL;
}

/* exactly n numbers separated by commas; whole: integers; false: text is not that */
static bool read_list(const char *text, int n, bool whole, double *out)
{
    for (int k = 0; k < n; k++) {
        char *end;
        out[k] = strtod(text, &end);
        if (end == text || !(fabs(out[k]) <= 1e9) || (whole && out[k] != floor(out[k]))) return false;
        if (*end != (k + 1 < n ? ',' : 0)) return false;
        text = end + 1;
    }
    return true;
}

static pal_err make_primitive(const primitive *p, const double count[3], const double size_m[3], pal_cells *out,
                              pal_diagnostic *diag)
{
    const int32_t n[3] = {(int32_t)count[0], (int32_t)count[1], (int32_t)count[2]};
    switch (p - primitive_list) {
    case 0:
        return pal_cells_block(n, size_m, out, diag);
    case 1:
        return pal_cells_ring(n[0], size_m[0], size_m[1], out, diag);
    case 2:
        return pal_cells_tube(n, size_m[0], size_m[1], size_m[2], out, diag);
    default:
        return pal_cells_torus(n[0], n[1], size_m[0], size_m[1], out, diag);
    }
}

static pal_err measure(outcome *o, pal_diagnostic *diag)
{
    const pal_cells *c = &o->made.cells;
    pal_surface surface;
    o->control_m3 = pal_cells_volume(&o->control, NULL);
    o->volume_m3 = pal_cells_volume(c, NULL);
    PAL_TRY(pal_cells_find_topology(c, &o->topology));
    PAL_TRY(pal_cells_boundary(c, &surface, NULL, NULL));
    double low[3], high[3];
    pal_surface_box(&surface, low, high);
    for (int a = 0; a < 3; a++) o->size_m[a] = high[a] - low[a];
    o->n_triangle = surface.n_tri;
    o->n_boundary_vertex = surface.n_vertex;
    pal_surface_free(&surface);
    pal_err err = pal_cell_elements_make(c, &o->elements, o->made.n_level ? diag : NULL);
    o->has_elements = !err;
    return err == PAL_ERR_REFUSED && o->made.n_level == 0 ? PAL_ERR_OK : err;
}

static pal_err subdivide(outcome *o, int n_level, pal_subdivision_rule rule, pal_diagnostic *diag)
{
    const pal_subdivision_options options = {.n_level = n_level, .rule = rule};
    pal_err err = pal_subdivision_make(&o->control, &options, &o->made, diag);
    if (!err) err = measure(o, diag);
    return pal_diagnostic_prefix(diag, err, o->name);
}

static cJSON *as_json(const outcome *o, const char *rule)
{
    const pal_cells *c = &o->made.cells;
    const pal_cell_elements *e = &o->elements;
    const pal_cell_model *m = o->model;
    cJSON *to =
        PAL_JSON({"ok", JSON_BOOL(true)}, {"name", JSON_TEXT(o->name)}, {"levels", JSON_NUMBER(o->made.n_level)},
                 {"rule", JSON_TEXT(rule)}, {"control_cells", JSON_NUMBER(o->control.n_cell)},
                 {"control_vertices", JSON_NUMBER(o->control.n_vertex)}, {"cells", JSON_NUMBER(c->n_cell)},
                 {"vertices", JSON_NUMBER(c->n_vertex)});
    if (o->has_elements)
        PAL_JSON_ADD(to, {"elements", JSON_NUMBER(pal_cell_elements_count(e))},
                     {"cubic_percent", JSON_NUMBER(pal_cell_elements_percent(e, PAL_CELL_CUBIC))},
                     {"linear_percent", JSON_NUMBER(pal_cell_elements_percent(e, PAL_CELL_HEX))},
                     {"pyramid_percent", JSON_NUMBER(pal_cell_elements_percent(e, PAL_CELL_PYRAMID))});
    if (m && m->n_element)
        PAL_JSON_ADD(to,
                     {"paper", PAL_JSON({"levels", JSON_NUMBER(m->n_level)}, {"control_cells", JSON_NUMBER(m->n_cell)},
                                        {"elements", JSON_NUMBER(m->n_element)},
                                        {"percent", cJSON_CreateIntArray(m->percent, PAL_CELL_KINDS)})});
    return PAL_JSON_ADD(
        to, {"pieces", JSON_NUMBER(o->topology.n_piece)}, {"genus", JSON_NUMBER(o->topology.genus)},
        {"cavities", JSON_NUMBER(o->topology.n_cavity)}, {"pinched_edges", JSON_NUMBER(c->n_pinched_edge)},
        {"pinched_vertices", JSON_NUMBER(c->n_pinched_vertex)}, {"size_m", cJSON_CreateDoubleArray(o->size_m, 3)},
        {"control_volume_m3", JSON_NUMBER(o->control_m3)}, {"volume_m3", JSON_NUMBER(o->volume_m3)},
        {"boundary_vertices", JSON_NUMBER(o->n_boundary_vertex)}, {"boundary_triangles", JSON_NUMBER(o->n_triangle)},
        {"bytes", JSON_NUMBER(o->made.n_byte)});
}

static const char *plural(int64_t n)
{
    return n == 1 ? "" : "s";
}

static void print(const outcome *o, const char *rule)
{
    const pal_cells *c = &o->made.cells;
    printf("%s: %d control cell%s, %.0f x %.0f x %.0f mm\n", o->name, o->control.n_cell, plural(o->control.n_cell),
           1e3 * o->size_m[0], 1e3 * o->size_m[1], 1e3 * o->size_m[2]);
    printf("%d level%s of %s: %d cell%s, %d vertices\n", o->made.n_level, plural(o->made.n_level), rule, c->n_cell,
           plural(c->n_cell), c->n_vertex);
    if (o->has_elements)
        printf("%d finite element%s: %.1f %% cubic, %.1f %% linear, %.1f %% pyramids\n",
               pal_cell_elements_count(&o->elements), plural(pal_cell_elements_count(&o->elements)),
               pal_cell_elements_percent(&o->elements, PAL_CELL_CUBIC),
               pal_cell_elements_percent(&o->elements, PAL_CELL_HEX),
               pal_cell_elements_percent(&o->elements, PAL_CELL_PYRAMID));
    else
        printf("no finite elements yet: some cells are no hexahedra; one level of subdivision makes them hexahedra\n");
    printf("%d piece%s, genus %d, %d cavit%s", o->topology.n_piece, plural(o->topology.n_piece), o->topology.genus,
           o->topology.n_cavity, o->topology.n_cavity == 1 ? "y" : "ies");
    if (c->n_pinched_edge + c->n_pinched_vertex > 0)
        printf(", pinched in %d edges and %d vertices", c->n_pinched_edge, c->n_pinched_vertex);
    printf("; %.6g ml of the control cells' %.6g ml; %.1f MB\n", 1e6 * o->volume_m3, 1e6 * o->control_m3,
           1e-6 * (double)o->made.n_byte);
}

/* a row of paper A, Table 1: our figures, then those of the paper */
static void print_row(const outcome *o)
{
    const pal_cell_model *m = o->model;
    const pal_cell_elements *e = &o->elements;
    char paper[64] = "-";
    if (m->n_element)
        snprintf(paper, sizeof paper, "%d: %d %d %d", m->n_element, m->percent[0], m->percent[1], m->percent[2]);
    printf("%-8s %6d %6d %6d %5.1f %5.1f %5.1f   %-16s %5d %10.1f %7.2f   %s\n", m->name, o->made.n_level,
           o->control.n_cell, pal_cell_elements_count(e), pal_cell_elements_percent(e, PAL_CELL_CUBIC),
           pal_cell_elements_percent(e, PAL_CELL_HEX), pal_cell_elements_percent(e, PAL_CELL_PYRAMID), paper,
           o->topology.genus, 1e6 * o->volume_m3, 1e-6 * (double)o->made.n_byte, m->about);
}

static int list_models(const pal_flag_common *common, pal_subdivision_rule rule, const char *rule_name)
{
    cJSON *list = cJSON_CreateArray();
    pal_diagnostic diag = {""};
    pal_err err = PAL_ERR_OK;
    if (!common->json && !common->quiet)
        printf("%-8s %6s %6s %6s %5s %5s %5s   %-16s %5s %10s %7s\n", "name", "levels", "#CC", "#FE", "%BE", "%LE",
               "%PE", "paper A", "genus", "volume ml", "MB");
    for (int k = 0; k < PAL_CELL_MODELS && !err; k++) {
        outcome o = {.model = &pal_cell_model_list[k]};
        snprintf(o.name, sizeof o.name, "%s", o.model->name);
        err = pal_cell_model_make(o.model, &o.control, &diag);
        if (!err) err = subdivide(&o, o.model->n_level, rule, &diag);
        if (!err && common->json) cJSON_AddItemToArray(list, as_json(&o, rule_name));
        if (!err && !common->json && !common->quiet) print_row(&o);
        free_outcome(&o);
    }
    return pal_report_end(common, err, &diag, PAL_JSON({"ok", JSON_BOOL(true)}, {"models", list}));
}

static bool ends_in(const char *path, const char *const *end)
{
    for (size_t n = strlen(path); *end; end++)
        if (n > strlen(*end) && !strcmp(path + n - strlen(*end), *end)) return true;
    return false;
}

static const char *const cell_end[] = {".palcells", ".vtk", NULL};
static const char *const surface_end[] = {".ply", ".obj", ".stl", NULL};

static pal_err write_file(const outcome *o, const char *path, pal_diagnostic *diag)
{
    pal_surface surface;
    if (ends_in(path, cell_end)) return pal_cell_file_save(&o->made.cells, path, diag);
    PAL_TRY(pal_cells_boundary(&o->made.cells, &surface, NULL, NULL));
    pal_err err = pal_mesh_file_write(path, &surface, diag);
    pal_surface_free(&surface);
    return err;
}

static int run(const pal_flag_common *common, outcome *o, const arguments *args, pal_subdivision_rule rule)
{
    pal_diagnostic diag = {""};
    pal_err err = subdivide(o, args->n_level, rule, &diag);
    if (!err && args->file) err = write_file(o, args->file, &diag);
    if (err) return pal_report_refusal(common, err, &diag);
    if (common->json)
        return pal_report_json(
            common, PAL_JSON_ADD(as_json(o, args->rule), {"file", args->file ? JSON_TEXT(args->file) : NULL}));
    if (common->quiet) return 0;
    print(o, args->rule);
    if (args->file && ends_in(args->file, cell_end)) printf("wrote the cells to %s\n", args->file);
    if (args->file && ends_in(args->file, surface_end))
        printf("wrote the boundary, %d triangles, to %s\n", o->n_triangle, args->file);
    return 0;
}

/* -1: the control cells are made, else the exit code */
static int make_control(const pal_flag_common *common, const char *shape, const arguments *args, outcome *o)
{
    const primitive *p = find_primitive(shape);
    pal_diagnostic diag = {""};
    pal_err err;
    snprintf(o->name, sizeof o->name, "%.100s", shape);
    o->model = pal_cell_model_find(shape);
    if (p) {
        double count[3], size_m[3];
        memcpy(count, p->count, sizeof count);
        memcpy(size_m, p->size_m, sizeof size_m);
        if (args->cells && !read_list(args->cells, p->n_count, true, count))
            return pal_flags_wrong(common, "--cells: \"%.40s\" is not %d whole number%s separated by commas (%s)",
                                   args->cells, p->n_count, plural(p->n_count), p->cells_are);
        if (args->size && !read_list(args->size, p->n_size, false, size_m))
            return pal_flags_wrong(common, "--size-m: \"%.40s\" is not %d numbers separated by commas (%s)", args->size,
                                   p->n_size, p->sizes_are);
        err = make_primitive(p, count, size_m, &o->control, &diag);
    } else if (args->cells || args->size) {
        return pal_flags_wrong(common, "%s: only goes with block, ring, tube and torus",
                               args->cells ? "--cells" : "--size-m");
    } else if (o->model) {
        err = pal_cell_model_make(o->model, &o->control, &diag);
    } else if (ends_in(shape, cell_end) || strchr(shape, '/')) {
        err = pal_cell_file_load(shape, &o->control, &diag);
    } else {
        return pal_flags_wrong(common, "there is no shape \"%.60s\"", shape);
    }
    return err ? pal_report_refusal(common, err, &diag) : -1;
}

static arguments args = {.rule = "maccracken_joy"};
static const pal_flag flag[] = {
    {"-o", "FILE", PAL_FLAG_TEXT, &args.file, 0, 0, "file to write: .palcells, .vtk, .ply, .obj or .stl"},
    {"--levels", "N", PAL_FLAG_COUNT, &args.n_level, 0, PAL_SUBDIVISION_MAX,
     "levels of subdivision; each multiplies the cells by eight (0)"},
    {"--rule", "maccracken_joy|averaging", PAL_FLAG_WORD, &args.rule, 0, 0, "rule of subdivision (maccracken_joy)"},
    {"--cells", "N,...", PAL_FLAG_TEXT, &args.cells, 0, 0,
     "numbers of cells: block along x, y, z (3,3,3); ring around (8); tube around, through the\nwall, along (8,1,4); "
     "torus around, across the middle (8,1)"},
    {"--size-m", "M,...", PAL_FLAG_TEXT, &args.size, 0, 0,
     "sizes: block along x, y, z (0.1,0.1,0.1); ring radius, thickness (0.05,0.02); tube inner\nradius, outer radius, "
     "length (0.02,0.03,0.1); torus radius, radius of the tube (0.05,0.02)"},
    {"--list", NULL, PAL_FLAG_SWITCH, &args.list, 0, 0,
     "without SHAPE: figures of the named solids beside those of paper A, Table 1"},
};

int command_cells(int argc, char **argv)
{
    const pal_flag_table table = {.usage = "cells SHAPE [-o FILE] [flags]",
                                  .about = about,
                                  .example = "palpate cells --list\n"
                                             "palpate cells chair --levels 1 -o chair.ply\n"
                                             "palpate cells block --cells 3,2,2 --size-m 0.12,0.06,0.06 -o "
                                             "block.palcells\n",
                                  PAL_FLAGS(flag),
                                  .operands = {0, 1}};
    pal_flag_common common;
    const char *word[1] = {NULL};
    int n = 0, code = pal_flags_parse(&table, argc, argv, &common, word, &n);
    if (code >= 0) return code;
    bool averaging = !strcmp(args.rule, "averaging");
    pal_subdivision_rule rule = averaging ? PAL_SUBDIVISION_AVERAGING : PAL_SUBDIVISION_MACCRACKEN_JOY;
    if (args.list == (n > 0)) return pal_flags_wrong(&common, "needs either a SHAPE or --list");
    if (args.list) {
        if (args.file || args.cells || args.size || args.n_level)
            return pal_flags_wrong(&common, "--list goes with --rule, --json and --quiet only");
        return list_models(&common, rule, args.rule);
    }
    if (args.file && !ends_in(args.file, cell_end) && !ends_in(args.file, surface_end))
        return pal_flags_wrong(&common, "-o: is not a .palcells, .vtk, .ply, .obj or .stl file");
    outcome o = {.model = NULL};
    code = make_control(&common, word[0], &args, &o);
    if (code < 0) code = run(&common, &o, &args, rule);
    free_outcome(&o);
    return code;
}
