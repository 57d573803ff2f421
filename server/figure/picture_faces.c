/* From a surface to the pieces of its picture: edges with their triangles, what looks at the eye, pieces in order. */
#include "server/figure/picture_faces.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/num/sort.h"

enum { DIVIDE_MAX = 8, CLASSES_A_PIECE = 2 };
static const double crease_cosine = 0.8; /* sharper than 37 degrees */

typedef struct edge {
    const pal_surface_side *side;
    int n;
} edge;

void pal_picture_axes_set(pal_picture_axes *axes, const double eye[3])
{
    static const double default_eye[3] = {0.5, -0.8, 0.35}, up[2][3] = {{0, 0, 1}, {0, 1, 0}};
    double size = fmax(fabs(eye[0]), fmax(fabs(eye[1]), fabs(eye[2]))), scaled[3] = {0, 0, 0};
    if (pal_finite3(eye) && size > 0) pal_scale3(scaled, 1 / size, eye);
    if (!pal_unit3(axes->eye, scaled, 1e-9)) pal_unit3(axes->eye, default_eye, 0);
    for (int k = 0; k < 2; k++) {
        double side[3];
        pal_cross3(side, up[k], axes->eye);
        if (pal_unit3(axes->right, side, 1e-6)) break;
    }
    pal_cross3(axes->up, axes->eye, axes->right);
}

void pal_picture_mesh_free(pal_picture_mesh *mesh)
{
    pal_surface_free(&mesh->surface);
    PAL_FREE(mesh->rest, mesh->value);
    *mesh = (pal_picture_mesh){0};
}

/* twice the area times the normal */
static void face_normal(const double *x, const int32_t tri[3], double normal[3])
{
    pal_normal3(normal, x + 3 * tri[0], x + 3 * tri[1], x + 3 * tri[2]);
}

static int count_seen(const pal_picture_mesh *m, const pal_picture_axes *axes)
{
    int n = 0;
    for (int t = 0; t < m->surface.n_tri; t++) {
        double normal[3];
        face_normal(m->surface.x, m->surface.tri + 3 * t, normal);
        n += !m->closed || pal_dot3(normal, axes->eye) > 0;
    }
    return n;
}

typedef struct cell {
    uint64_t key;
    int32_t vertex;
} cell;

static int by_key(const void *a, const void *b)
{
    const cell *p = a, *q = b;
    return p->key != q->key ? PAL_COMPARE(p->key, q->key) : PAL_COMPARE(p->vertex, q->vertex);
}

/* vertices of one cell become their mean; triangles that lose a corner go */
static pal_err join_cells(pal_picture_mesh *m, const double low[3], double size)
{
    size_t n = (size_t)m->surface.n_vertex;
    pal_err err = PAL_ERR_OK;
    cell *c;
    int32_t *to;
    PAL_ARRAY(&err, c, n);
    PAL_ARRAY(&err, to, n);
    if (err) {
        PAL_FREE(c, to);
        return err;
    }
    for (size_t i = 0; i < n; i++) {
        c[i] = (cell){0, (int32_t)i};
        for (int k = 0; k < 3; k++)
            c[i].key = c[i].key << 21 | (uint64_t)((m->surface.x[3 * i + (size_t)k] - low[k]) / size);
    }
    qsort(c, n, sizeof *c, by_key);
    int n_cell = 0;
    /* sums go to the cell's own lowest vertex: no cell is written over before it is read */
    for (size_t i = 0, j; i < n; i = j, n_cell++) {
        int32_t first = c[i].vertex;
        double some = isfinite(m->value[first]);
        if (some == 0) m->value[first] = 0;
        for (j = i + 1; j < n && c[j].key == c[i].key; j++) {
            int32_t v = c[j].vertex;
            to[v] = first;
            pal_axpy3(m->surface.x + 3 * first, 1, m->surface.x + 3 * v);
            if (m->rest) pal_axpy3(m->rest + 3 * first, 1, m->rest + 3 * v);
            if (isfinite(m->value[v])) m->value[first] += m->value[v], some++;
        }
        to[first] = first;
        pal_scale3(m->surface.x + 3 * first, 1.0 / (double)(j - i), m->surface.x + 3 * first);
        if (m->rest) pal_scale3(m->rest + 3 * first, 1.0 / (double)(j - i), m->rest + 3 * first);
        m->value[first] = some > 0 ? m->value[first] / some : NAN;
    }
    int kept = 0;
    for (int t = 0; t < m->surface.n_tri; t++) {
        int32_t a = to[m->surface.tri[3 * t]], b = to[m->surface.tri[3 * t + 1]], d = to[m->surface.tri[3 * t + 2]];
        if (a == b || b == d || d == a) continue;
        m->surface.tri[3 * kept] = a, m->surface.tri[3 * kept + 1] = b, m->surface.tri[3 * kept + 2] = d, kept++;
    }
    m->surface.n_tri = kept;
    PAL_FREE(c, to);
    return PAL_ERR_OK;
}

pal_err pal_picture_mesh_prepare(pal_picture_mesh *m, const pal_picture_axes *axes, int max)
{
    const pal_surface *s = &m->surface;
    pal_surface_topology found;
    PAL_TRY(pal_surface_check(s, &found));
    const bool closed = m->closed = found.closed && found.oriented && found.n_nonmanifold_edge == 0;
    if (closed && pal_surface_volume(s) < 0)
        for (int t = 0; t < m->surface.n_tri; t++) {
            int32_t other = m->surface.tri[3 * t + 1];
            m->surface.tri[3 * t + 1] = m->surface.tri[3 * t + 2], m->surface.tri[3 * t + 2] = other;
        }
    int seen = count_seen(m, axes);
    if (seen <= max) return PAL_ERR_OK;
    double low[3], high[3];
    pal_surface_box(s, low, high);
    /* a cell that a surface crosses gives about two triangles; half of them are seen */
    double size = fmax(sqrt(pal_surface_area(s) / max) * (closed ? 0.7 : 1), 1e-6 * pal_dist3(low, high));
    for (; seen > max && size > 0; size *= 1.2) {
        PAL_TRY(join_cells(m, low, size));
        m->closed = closed; /* cells fold a closed surface but open none */
        m->joined = true;
        seen = count_seen(m, axes);
    }
    return PAL_ERR_OK;
}

typedef struct face {
    double p[3][3]; /* projected corners */
    double value[3];
    uint8_t outline, crease;
    bool seen;
    uint8_t shade;
} face;

static void make_faces(const pal_picture_mesh *m, const pal_picture_axes *axes, face *f)
{
    double light[3];
    for (int k = 0; k < 3; k++) light[k] = axes->eye[k] + 0.40 * axes->up[k] - 0.28 * axes->right[k];
    pal_unit3(light, light, 0);
    for (int t = 0; t < m->surface.n_tri; t++) {
        double normal[3];
        face_normal(m->surface.x, m->surface.tri + 3 * t, normal);
        bool some = pal_unit3(normal, normal, 0);
        double facing = some ? pal_dot3(normal, axes->eye) : 0, lit = some ? pal_dot3(normal, light) : 1;
        if (!m->closed && facing < 0) facing = -facing, lit = -lit;
        f[t].seen = facing > 0;
        /* what looks straight at the eye has its colour to the bit */
        double shade = (PAL_PICTURE_SHADES - 1) * fmin(1, fmax(0, lit) / 0.87);
        f[t].shade = (uint8_t)lround(shade);
        for (int k = 0; k < 3; k++) {
            int32_t v = m->surface.tri[3 * t + k];
            pal_picture_project(axes, m->surface.x + 3 * v, f[t].p[k]);
            f[t].value[k] = m->value[v];
        }
        f[t].outline = f[t].crease = 0;
    }
}

/* the normals of the two triangles of an edge, the second reversed where both run the same way through it; false: it
 * has not two */
static bool edge_normals(const pal_picture_mesh *m, const double *x, const edge *e, double normal[2][3])
{
    if (e->n != 2) return false;
    for (int i = 0; i < 2; i++) face_normal(x, m->surface.tri + 3 * (e->side[i].corner / 3), normal[i]);
    if (m->surface.tri[e->side[0].corner] == m->surface.tri[e->side[1].corner]) pal_scale3(normal[1], -1, normal[1]);
    return true;
}

/* is the edge an outline of positions x seen from the eye: an end of the surface, or the border between what looks at
 * the eye and what does not? Not where joining vertices has folded the surface */
static bool is_outline(const pal_picture_mesh *m, const double *x, const double eye[3], const edge *e)
{
    double normal[2][3];
    if (!edge_normals(m, x, e, normal)) return !m->joined;
    bool folded = pal_dot3(normal[0], normal[1]) < -0.3 * pal_norm3(normal[0]) * pal_norm3(normal[1]);
    return (pal_dot3(normal[0], eye) > 0) != (pal_dot3(normal[1], eye) > 0) && !(m->joined && folded);
}

static bool is_crease(const pal_picture_mesh *m, const edge *e)
{
    double normal[2][3];
    if (m->joined || !edge_normals(m, m->surface.x, e, normal)) return false;
    if (!pal_unit3(normal[0], normal[0], 0) || !pal_unit3(normal[1], normal[1], 0)) return false;
    return pal_dot3(normal[0], normal[1]) < crease_cosine;
}

static pal_err mark_edges(const pal_picture_mesh *m, const pal_picture_axes *axes, face *f, pal_picture_line **ghost,
                          int *n_ghost)
{
    int32_t *start;
    pal_surface_side *side;
    PAL_TRY(pal_surface_sides(&m->surface, &start, &side));
    pal_err err = PAL_ERR_OK;
    if (m->rest) PAL_ARRAY(&err, *ghost, 3 * m->surface.n_tri);
    for (int32_t v = 0; v < m->surface.n_vertex && !err; v++)
        for (int32_t i = start[v], end = i; i < start[v + 1]; i = end) {
            while (end < start[v + 1] && side[end].high == side[i].high) end++;
            const edge e = {side + i, end - i};
            bool outline = is_outline(m, m->surface.x, axes->eye, &e), crease = !outline && is_crease(m, &e);
            for (int k = i; k < end; k++) {
                uint8_t bit = (uint8_t)(1 << side[k].corner % 3);
                if (outline) f[side[k].corner / 3].outline |= bit;
                if (crease) f[side[k].corner / 3].crease |= bit;
            }
            if (!m->rest || !is_outline(m, m->rest, axes->eye, &e)) continue;
            double a[3], b[3];
            pal_picture_project(axes, m->rest + 3 * v, a);
            pal_picture_project(axes, m->rest + 3 * side[i].high, b);
            (*ghost)[(*n_ghost)++] = (pal_picture_line){{a[0], a[1]}, {b[0], b[1]}};
        }
    PAL_FREE(start, side);
    return err;
}

/* parts of each edge, so that a part spans few colours */
static int divisions(const face *f, int max)
{
    double low = fmin(f->value[0], fmin(f->value[1], f->value[2]));
    double high = fmax(f->value[0], fmax(f->value[1], f->value[2]));
    double apart = (high - low) * PAL_PICTURE_CLASSES;
    for (int k = 0; k < 3; k++)
        if (!isfinite(f->value[k])) return 1;
    return apart < max * CLASSES_A_PIECE ? (int)fmax(1, ceil(apart / CLASSES_A_PIECE)) : max;
}

/* corner (i, j) of a triangle divided into parts^2: towards corner 1 and corner 2 */
static void put_corner(const face *f, int parts, int i, int j, pal_picture_piece *out, int corner, double *value)
{
    double b = (double)i / parts, c = (double)j / parts, a = 1 - b - c, at[3];
    for (int k = 0; k < 3; k++) at[k] = a * f->p[0][k] + b * f->p[1][k] + c * f->p[2][k];
    out->at[corner][0] = at[0], out->at[corner][1] = at[1];
    out->depth += at[2] / 3;
    *value += (a * f->value[0] + b * f->value[1] + c * f->value[2]) / 3;
}

static void put_piece(const face *f, int parts, const int ij[3][2], uint8_t edges, pal_picture_piece *out)
{
    double value = 0;
    *out = (pal_picture_piece){.shade = f->shade, .outline = f->outline & edges, .crease = f->crease & edges};
    for (int k = 0; k < 3; k++) put_corner(f, parts, ij[k][0], ij[k][1], out, k, &value);
    value = fmin(1, fmax(0, value)) + 0 * value; /* NaN stays */
    out->colour = isfinite(value) ? (int16_t)lround(value * (PAL_PICTURE_CLASSES - 1)) : PAL_PICTURE_GREY;
}

static int put_face(const face *f, int parts, pal_picture_piece *out)
{
    int n = 0;
    for (int i = 0; i < parts; i++)
        for (int j = 0; i + j < parts; j++) {
            uint8_t edges = (uint8_t)((j == 0) | (i + j == parts - 1) << 1 | (i == 0) << 2);
            put_piece(f, parts, (const int[3][2]){{i, j}, {i + 1, j}, {i, j + 1}}, edges, out + n++);
            if (i + j + 1 < parts)
                put_piece(f, parts, (const int[3][2]){{i + 1, j}, {i + 1, j + 1}, {i, j + 1}}, 0, out + n++);
        }
    return n;
}

static int by_depth(const void *a, const void *b)
{
    const pal_picture_piece *p = a, *q = b;
    return p->depth != q->depth ? PAL_COMPARE(p->depth, q->depth) : memcmp(p->at, q->at, sizeof p->at);
}

pal_err pal_picture_pieces(const pal_picture_mesh *m, const pal_picture_axes *axes, int max, pal_picture_piece **piece,
                           int *n_piece, pal_picture_line **ghost, int *n_ghost)
{
    *piece = NULL, *ghost = NULL;
    *n_piece = *n_ghost = 0;
    pal_err err = PAL_ERR_OK;
    face *f;
    PAL_ARRAY(&err, f, m->surface.n_tri);
    if (err) return err;
    make_faces(m, axes, f);
    err = mark_edges(m, axes, f, ghost, n_ghost);
    int parts = DIVIDE_MAX + 1;
    long long n;
    do {
        n = 0, parts--;
        for (int t = 0; t < m->surface.n_tri; t++) {
            int d = f[t].seen ? divisions(&f[t], parts) : 0;
            n += d * d;
        }
    } while (n > max && parts > 1);
    PAL_ARRAY(&err, *piece, n);
    for (int t = 0; t < m->surface.n_tri && !err; t++)
        if (f[t].seen) *n_piece += put_face(&f[t], divisions(&f[t], parts), *piece + *n_piece);
    if (!err) qsort(*piece, (size_t)*n_piece, sizeof **piece, by_depth);
    if (err) {
        free(*ghost);
        *ghost = NULL;
        *n_ghost = 0;
    }
    free(f);
    return err;
}
