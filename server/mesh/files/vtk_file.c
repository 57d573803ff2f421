/* Legacy VTK, version 3.0, and XML, version 1.0, all ASCII (VTK User's Guide, "VTK File Formats").
 *
 * VTK goes around the lower face of a hexahedron and then around the upper one, so corners 2 and 3, 6 and 7 change
 * places; its quadratic tetrahedron has the middles of edges 01 12 20 03 13 23, as num/shape_functions.h has. */
#include "server/mesh/files/vtk_file.h"

#include "server/base/vec3.h"
#include "server/mesh/files/file_bytes.h"

#include <string.h>

static const uint8_t HEX_ORDER[8] = {0, 1, 3, 2, 4, 5, 7, 6};

static int cell_type(int n_corner)
{
    return n_corner == 8 ? 12 : n_corner == 4 ? 10 : n_corner == 10 ? 24 : 0;
}

/* a word without blanks, or the title's line */
static void write_word(FILE *file, const char *word, bool blanks)
{
    int n = 0;
    for (; word[n] && n < 200; n++) {
        unsigned char c = (unsigned char)word[n];
        fputc(c < 0x20 || c == 0x7F || (c == ' ' && !blanks) ? '_' : c, file);
    }
    if (n == 0) fputs("field", file);
}

static void write_fields(FILE *file, const char *where, const pal_vtk_field *field, int n_field, int n)
{
    if (n_field > 0) fprintf(file, "%s %d\n", where, n);
    for (int f = 0; f < n_field; f++) {
        bool vector = field[f].n_component == 3;
        fputs(vector ? "VECTORS " : "SCALARS ", file);
        write_word(file, field[f].name, false);
        fputs(vector ? " double\n" : " double 1\nLOOKUP_TABLE default\n", file);
        for (size_t i = 0; i < (size_t)n; i++)
            pal_file_put_line(file, field[f].value + i * (vector ? 3 : 1), vector ? 3 : 1);
    }
}

static void write_cells(FILE *file, const pal_vtk_grid *g)
{
    fprintf(file, "CELLS %d %lld\n", g->n_element, (long long)g->n_element * (g->n_corner + 1));
    for (size_t e = 0; e < (size_t)g->n_element; e++) {
        const int32_t *node = g->node + e * (size_t)g->n_corner;
        fprintf(file, "%d", g->n_corner);
        for (int c = 0; c < g->n_corner; c++) fprintf(file, " %d", node[g->n_corner == 8 ? HEX_ORDER[c] : c]);
        fputc('\n', file);
    }
    fprintf(file, "CELL_TYPES %d\n", g->n_element);
    for (int e = 0; e < g->n_element; e++) fprintf(file, "%d\n", cell_type(g->n_corner));
}

static pal_err check_fields(const pal_vtk_field *field, int n, const char *path, pal_diagnostic *diag)
{
    for (int f = 0; f < n; f++)
        if (field[f].n_component != 1 && field[f].n_component != 3)
            return PAL_REFUSE(diag, "%s: field %.60s has %d components, not 1 or 3", path, field[f].name,
                              field[f].n_component);
    return PAL_ERR_OK;
}

static pal_err check_grid(const pal_vtk_grid *g, const char *path, pal_diagnostic *diag)
{
    if (!cell_type(g->n_corner)) return PAL_REFUSE(diag, "%s: elements of %d corners", path, g->n_corner);
    PAL_TRY(check_fields(g->point, g->n_point, path, diag));
    return check_fields(g->cell, g->n_cell, path, diag);
}

static void write_points(FILE *file, const pal_vtk_grid *g)
{
    for (size_t i = 0; i < (size_t)g->n_node; i++) {
        double x[3];
        pal_copy3(x, g->x + 3 * i);
        if (g->origin_m) pal_add3(x, x, g->origin_m);
        pal_file_put_line(file, x, 3);
    }
}

/* ---- XML ---- */

/* a name that needs no escape in an attribute */
static void begin_array(FILE *file, const char *type, const char *name, int n_component)
{
    char word[64];
    size_t n = 0;
    for (; name[n] && n + 1 < sizeof word; n++) {
        unsigned char c = (unsigned char)name[n];
        word[n] = c <= 0x20 || c == 0x7F || strchr("<>&\"'", c) ? '_' : (char)c;
    }
    word[n] = 0;
    fprintf(file, "<DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%d\" format=\"ascii\">\n", type, word,
            n_component);
}

static void end_array(FILE *file)
{
    fputs("</DataArray>\n", file);
}

static void write_arrays(FILE *file, const char *where, const pal_vtk_field *field, int n_field, int n)
{
    fprintf(file, "<%s>\n", where);
    for (int f = 0; f < n_field; f++) {
        begin_array(file, "Float64", field[f].name, field[f].n_component);
        for (size_t i = 0; i < (size_t)n; i++)
            pal_file_put_line(file, field[f].value + i * (size_t)field[f].n_component, field[f].n_component);
        end_array(file);
    }
    fprintf(file, "</%s>\n", where);
}

static void write_connectivity(FILE *file, const pal_vtk_grid *g)
{
    begin_array(file, "Int32", "connectivity", 1);
    for (size_t e = 0; e < (size_t)g->n_element; e++)
        for (int c = 0; c < g->n_corner; c++)
            fprintf(file, "%d%c", g->node[e * (size_t)g->n_corner + (g->n_corner == 8 ? HEX_ORDER[c] : (unsigned)c)],
                    c + 1 < g->n_corner ? ' ' : '\n');
    end_array(file);
    begin_array(file, "Int64", "offsets", 1);
    for (int e = 1; e <= g->n_element; e++) fprintf(file, "%lld\n", (long long)e * g->n_corner);
    end_array(file);
}

static void write_cell_types(FILE *file, const pal_vtk_grid *g)
{
    begin_array(file, "UInt8", "types", 1);
    for (int e = 0; e < g->n_element; e++) fprintf(file, "%d\n", cell_type(g->n_corner));
    end_array(file);
}

/* cells: "Cells" with types, or "Polys" without */
static pal_err write_xml(const char *path, const char *type, const char *cells, const pal_vtk_grid *g,
                         pal_diagnostic *diag)
{
    pal_file_out out;
    PAL_TRY(pal_file_begin(&out, path, diag));
    fprintf(out.file,
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"%s\" version=\"1.0\" byte_order=\"LittleEndian\" "
            "header_type=\"UInt64\">\n<%s>\n<Piece NumberOfPoints=\"%d\" NumberOf%s=\"%d\">\n",
            type, type, g->n_node, cells, g->n_element);
    fputs("<Points>\n", out.file);
    begin_array(out.file, "Float64", "Points", 3);
    write_points(out.file, g);
    end_array(out.file);
    fprintf(out.file, "</Points>\n<%s>\n", cells);
    write_connectivity(out.file, g);
    if (!strcmp(cells, "Cells")) write_cell_types(out.file, g);
    fprintf(out.file, "</%s>\n", cells);
    write_arrays(out.file, "PointData", g->point, g->n_point, g->n_node);
    write_arrays(out.file, "CellData", g->cell, g->n_cell, g->n_element);
    fprintf(out.file, "</Piece>\n</%s>\n</VTKFile>\n", type);
    return pal_file_end(&out, diag);
}

pal_err pal_mesh_write_vtu(const char *path, const pal_vtk_grid *g, pal_diagnostic *diag)
{
    PAL_TRY(check_grid(g, path, diag));
    return write_xml(path, "UnstructuredGrid", "Cells", g, diag);
}

pal_err pal_mesh_write_vtp(const char *path, const pal_vtk_grid *g, pal_diagnostic *diag)
{
    if (g->n_corner != 3) return PAL_REFUSE(diag, "%s: elements of %d corners, not triangles", path, g->n_corner);
    PAL_TRY(check_fields(g->point, g->n_point, path, diag));
    PAL_TRY(check_fields(g->cell, g->n_cell, path, diag));
    return write_xml(path, "PolyData", "Polys", g, diag);
}

/* ---- legacy ---- */

pal_err pal_mesh_write_vtk(const char *path, const pal_vtk_grid *g, pal_diagnostic *diag)
{
    pal_file_out out;
    if (pal_file_ends_with(path, ".vtu")) return pal_mesh_write_vtu(path, g, diag);
    PAL_TRY(check_grid(g, path, diag));
    PAL_TRY(pal_file_begin(&out, path, diag));
    fputs("# vtk DataFile Version 3.0\n", out.file);
    write_word(out.file, g->title ? g->title : "mesh", true);
    fprintf(out.file, "\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS %d double\n", g->n_node);
    write_points(out.file, g);
    write_cells(out.file, g);
    write_fields(out.file, "POINT_DATA", g->point, g->n_point, g->n_node);
    write_fields(out.file, "CELL_DATA", g->cell, g->n_cell, g->n_element);
    return pal_file_end(&out, diag);
}
