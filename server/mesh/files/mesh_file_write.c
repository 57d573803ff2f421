/* Files out: surfaces as binary PLY and STL and text OBJ, tetrahedra as TetGen .node, .ele and .face. */
#include "server/base/vec3.h"
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/mesh_file.h"

#include <string.h>

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "files are written in the host's order");

static void write_ply(FILE *file, const pal_surface *surface)
{
    fprintf(file,
            "ply\nformat binary_little_endian 1.0\ncomment metres\nelement vertex %d\nproperty float x\n"
            "property float y\nproperty float z\nelement face %d\nproperty list uchar int vertex_indices\n"
            "end_header\n",
            surface->n_vertex, surface->n_tri);
    for (size_t i = 0; i < (size_t)surface->n_vertex; i++) {
        float p[3];
        for (size_t a = 0; a < 3; a++) p[a] = (float)(surface->x[3 * i + a] + surface->origin_m[a]);
        fwrite(p, sizeof p, 1, file);
    }
    for (size_t t = 0; t < (size_t)surface->n_tri; t++) {
        uint8_t row[13] = {3};
        memcpy(row + 1, surface->tri + 3 * t, 12);
        fwrite(row, sizeof row, 1, file);
    }
}

/* writes a number and a blank at p and returns the end; about ten times as fast as printf */
static char *put_int(char *p, int64_t value)
{
    char turned[24];
    int n = 0;
    if (value < 0) *p++ = '-';
    uint64_t left = value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
    do turned[n++] = (char)('0' + left % 10);
    while ((left /= 10) > 0);
    while (n > 0) *p++ = turned[--n];
    *p++ = ' ';
    return p;
}

/* twelve decimals (picometres) where that is exact enough, else 17 digits, which read back equal */
static char *put_metres(char *p, double x, bool fixed)
{
    if (!fixed || !(fabs(x) < 1e6)) {
        char *end = p + snprintf(p, 32, "%.17g ", x);
        for (; p < end; p++)
            if (*p == ',') *p = '.'; /* the decimal point of the locale */
        return end;
    }
    int64_t pico = (int64_t)(fabs(x) * 1e12 + 0.5), whole = pico / 1000000000000, rest = pico % 1000000000000;
    if (x < 0 && pico > 0) *p++ = '-';
    p = put_int(p, whole) - 1;
    *p++ = '.';
    for (int k = 11; k >= 0; k--, rest /= 10) p[k] = (char)('0' + rest % 10);
    p += 12;
    *p++ = ' ';
    return p;
}

static void end_row(FILE *file, char *row, char *end)
{
    end[-1] = '\n';
    fwrite(row, 1, (size_t)(end - row), file);
}

static void write_nodes(FILE *file, const pal_tets *tets)
{
    char row[160];
    /* picometres are enough for bodies of more than a tenth of a millimetre */
    bool fixed = tets->edge_m > 1e-6;
    fprintf(file, "%d 3 0 1\n", tets->n_node);
    for (size_t i = 0; i < (size_t)tets->n_node; i++) {
        char *p = put_int(row, (int64_t)i + 1);
        for (size_t a = 0; a < 3; a++) p = put_metres(p, tets->x[3 * i + a] + tets->origin_m[a], fixed);
        end_row(file, row, put_int(p, tets->on_surface && tets->on_surface[i]));
    }
}

/* rows of corners, 1-based, with a boundary marker of 1 if marked */
static void write_corners(FILE *file, const int32_t *corner, int n_row, size_t n_corner, bool marked)
{
    char row[160];
    for (size_t i = 0; i < (size_t)n_row; i++) {
        char *p = put_int(row, (int64_t)i + 1);
        for (size_t k = 0; k < n_corner; k++) p = put_int(p, corner[n_corner * i + k] + 1);
        end_row(file, row, marked ? put_int(p, 1) : p);
    }
}

static void write_obj(FILE *file, const pal_surface *surface)
{
    char row[160];
    fprintf(file, "# metres\n");
    for (size_t i = 0; i < (size_t)surface->n_vertex; i++) {
        char *p = row + 2;
        row[0] = 'v', row[1] = ' ';
        for (size_t a = 0; a < 3; a++) p = put_metres(p, surface->x[3 * i + a] + surface->origin_m[a], false);
        end_row(file, row, p);
    }
    for (size_t t = 0; t < (size_t)surface->n_tri; t++) {
        char *p = row + 2;
        row[0] = 'f', row[1] = ' ';
        for (size_t k = 0; k < 3; k++) p = put_int(p, (int64_t)surface->tri[3 * t + k] + 1);
        end_row(file, row, p);
    }
}

static void write_stl(FILE *file, const pal_surface *surface)
{
    char head[80] = "binary, metres";
    uint32_t n_tri = (uint32_t)surface->n_tri;
    fwrite(head, sizeof head, 1, file);
    fwrite(&n_tri, sizeof n_tri, 1, file);
    for (size_t t = 0; t < (size_t)surface->n_tri; t++) {
        double normal[3];
        float row[12];
        const double *corner[3];
        for (size_t k = 0; k < 3; k++) corner[k] = surface->x + 3 * (size_t)surface->tri[3 * t + k];
        pal_normal3(normal, corner[0], corner[1], corner[2]);
        if (!pal_unit3(normal, normal, 0)) pal_set3(normal, 0, 0, 0);
        for (size_t a = 0; a < 3; a++) {
            row[a] = (float)normal[a];
            for (size_t k = 0; k < 3; k++) row[3 + 3 * k + a] = (float)(corner[k][a] + surface->origin_m[a]);
        }
        uint8_t packed[50] = {0};
        memcpy(packed, row, sizeof row);
        fwrite(packed, sizeof packed, 1, file);
    }
}

pal_err pal_mesh_file_write(const char *path, const pal_surface *surface, pal_diagnostic *diag)
{
    static const struct {
        const char *tail;
        void (*write)(FILE *file, const pal_surface *surface);
    } known[] = {{".ply", write_ply}, {".obj", write_obj}, {".stl", write_stl}};
    for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
        pal_file_out out;
        if (!pal_file_ends_with(path, known[k].tail)) continue;
        PAL_TRY(pal_file_begin(&out, path, diag));
        known[k].write(out.file, surface);
        return pal_file_end(&out, diag);
    }
    char shown[128];
    pal_file_printable_name(shown, path);
    return PAL_REFUSE(diag, "%s: surfaces are written to .ply, .obj or .stl files", shown);
}

pal_err pal_mesh_file_write_tetgen(const char *stem, const pal_tets *tets, pal_diagnostic *diag)
{
    static const char *const tail[3] = {".node", ".ele", ".face"};
    for (int k = 0; k < 3; k++) {
        char path[4096];
        if (strlen(stem) + 8 > sizeof path)
            return pal_diagnostic_set(diag, PAL_ERR_IO, "%.100s...: the path is too long", stem);
        snprintf(path, sizeof path, "%s%s", stem, tail[k]);
        pal_file_out out;
        PAL_TRY(pal_file_begin(&out, path, diag));
        if (k == 0) {
            write_nodes(out.file, tets);
        } else if (k == 1) {
            fprintf(out.file, "%d 4 0\n", tets->n_tet);
            write_corners(out.file, tets->tet, tets->n_tet, 4, false);
        } else {
            fprintf(out.file, "%d 1\n", tets->n_face);
            write_corners(out.file, tets->face, tets->n_face, 3, true);
        }
        PAL_TRY(pal_file_end(&out, diag));
    }
    return PAL_ERR_OK;
}
