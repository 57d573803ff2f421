/* From voxels to tetrahedra (paper B section 2.2; server/mesh/README.md). */
#include "server/mesh/voxel/voxels.h"

#include "server/base/heap.h"
#include "server/mesh/voxel/voxel_bits.h"

#include <sys/mman.h>

/* corner bits x = 1, y = 2, z = 4; every tetrahedron has positive volume */
const uint8_t pal_voxel_tets[2][5][4] = {
    {{0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}, {1, 2, 4, 7}},
    {{1, 3, 0, 5}, {2, 0, 3, 6}, {4, 0, 6, 5}, {7, 3, 5, 6}, {0, 3, 6, 5}},
};
/* faces of a tetrahedron of positive volume, counter-clockwise from outside */
static const uint8_t FACE[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

/* the two triangles of each side of the voxel (-x +x -y +y -z +z) in both patterns: the faces of the five tetrahedra
 * whose corners all lie on that side */
static void find_sides(uint8_t corner[2][6][6])
{
    for (int parity = 0; parity < 2; parity++)
        for (int side = 0; side < 6; side++) {
            uint8_t *to = corner[parity][side];
            for (int t = 0; t < 5; t++)
                for (int f = 0; f < 4; f++) {
                    int on = 0;
                    for (int k = 0; k < 3; k++)
                        on += (pal_voxel_tets[parity][t][FACE[f][k]] >> (side / 2) & 1) == (side & 1);
                    for (int k = 0; on == 3 && k < 3; k++) *to++ = pal_voxel_tets[parity][t][FACE[f][k]];
                }
        }
}

void *pal_voxels_array(size_t n_byte)
{
    size_t page = (size_t)2 << 20;
    if (n_byte < 2 * page) return malloc(n_byte ? n_byte : 1);
    n_byte = (n_byte + page - 1) / page * page;
    void *array = aligned_alloc(page, n_byte);
    if (array) (void)madvise(array, n_byte, MADV_HUGEPAGE);
    return array;
}

/* bytes of kind to bits */
static void read_kind(const pal_voxels *voxels, pal_bits *kept)
{
    int n_x = voxels->n[0];
    size_t n_row = (size_t)voxels->n[1] * (size_t)voxels->n[2];
    for (size_t row = 0; row < n_row; row++) {
        const uint8_t *from = voxels->kind + (size_t)n_x * row;
        uint64_t *to = kept->word + (size_t)kept->n_word * row;
        for (int x = 0; x < n_x; x += 8) {
            uint64_t bytes = 0;
            memcpy(&bytes, from + x, n_x - x < 8 ? (size_t)(n_x - x) : 8);
            if (!bytes) continue;
            bytes = (bytes | bytes >> 1) & 0x0101010101010101u;
            to[x >> 6] |= (bytes * 0x0102040810204080u >> 56) << (x & 63);
        }
    }
}

/* word w of a row moved by one voxel: bit x holds its neighbour at x - 1 or x + 1 */
static inline uint64_t from_left(const uint64_t *row, int w)
{
    return row[w] << 1 | (w > 0 ? row[w - 1] >> 63 : 0);
}

static inline uint64_t from_right(const uint64_t *row, int w, int n_word)
{
    return row[w] >> 1 | (w + 1 < n_word ? row[w + 1] << 63 : 0);
}

typedef struct splitter {
    const pal_voxels *voxels;
    pal_bits kept;     /* one voxel wider than the grid in x, so that nodes fit its words */
    uint64_t *empty;   /* a row of zeros                            [n_word]     */
    int32_t *plane[2]; /* node numbers below and above the voxels   [n1+1][n0+1] */
    uint8_t sides[2][6][6];
    pal_tets *tets;
    int64_t n_node, n_tet, n_face; /* counted first, then written so far */
} splitter;

/* row of kept voxels, empty beyond the grid */
static const uint64_t *kept_row(const splitter *s, int y, int z)
{
    if (y < 0 || z < 0 || y >= s->voxels->n[1] || z >= s->voxels->n[2]) return s->empty;
    return pal_bits_row(&s->kept, y, z);
}

/* nodes of lattice row (y, z): corners of any of the four rows of voxels around it */
static inline uint64_t node_word(const uint64_t *row[4], int w)
{
    uint64_t any = row[0][w] | row[1][w] | row[2][w] | row[3][w];
    uint64_t before = w > 0 ? (row[0][w - 1] | row[1][w - 1] | row[2][w - 1] | row[3][w - 1]) >> 63 : 0;
    return any | any << 1 | before;
}

static void rows_around(const splitter *s, int y, int z, const uint64_t *row[4])
{
    for (int k = 0; k < 4; k++) row[k] = kept_row(s, y - (k & 1), z - (k >> 1));
}

/* kept voxels of a word whose neighbour on a side is not kept */
static inline uint64_t exposed_word(const splitter *s, int y, int z, int w, int side)
{
    const uint64_t *row = kept_row(s, y, z);
    int step = side & 1 ? 1 : -1;
    if (side == 0) return row[w] & ~from_left(row, w);
    if (side == 1) return row[w] & ~from_right(row, w, s->kept.n_word);
    return row[w] & ~kept_row(s, side < 4 ? y + step : y, side < 4 ? z : z + step)[w];
}

static void count_all(splitter *s)
{
    int n_word = s->kept.n_word;
    s->n_tet = 5 * pal_bits_count(&s->kept);
    for (int z = 0; z <= s->voxels->n[2]; z++)
        for (int y = 0; y <= s->voxels->n[1]; y++) {
            const uint64_t *row[4];
            rows_around(s, y, z, row);
            for (int w = 0; w < n_word; w++) {
                s->n_node += __builtin_popcountll(node_word(row, w));
                if (!kept_row(s, y, z)[w]) continue;
                for (int side = 0; side < 6; side++)
                    s->n_face += 2 * __builtin_popcountll(exposed_word(s, y, z, w, side));
            }
        }
}

/* numbers and places the nodes of plane z */
static void write_nodes(splitter *s, int z)
{
    const pal_voxels *v = s->voxels;
    int stride = v->n[0] + 1;
    double place_z = v->low_m[2] + v->edge_m * z;
    for (int y = 0; y <= v->n[1]; y++) {
        const uint64_t *row[4];
        int32_t *number = s->plane[z & 1] + (size_t)stride * (size_t)y;
        double place_y = v->low_m[1] + v->edge_m * y;
        rows_around(s, y, z, row);
        for (int w = 0; w < s->kept.n_word; w++)
            for (uint64_t left = node_word(row, w); left; left &= left - 1) {
                int x = 64 * w + __builtin_ctzll(left);
                double *to = s->tets->x + 3 * (size_t)s->n_node;
                number[x] = (int32_t)s->n_node++;
                to[0] = v->low_m[0] + v->edge_m * x, to[1] = place_y, to[2] = place_z;
            }
    }
}

/* numbers of the eight corners of voxel x in row y */
static inline void corners(const splitter *s, int x, int y, int z, int32_t node[8])
{
    size_t stride = (size_t)s->voxels->n[0] + 1, at = stride * (size_t)y + (size_t)x;
    const int32_t *low = s->plane[z & 1] + at, *high = s->plane[(z + 1) & 1] + at;
    node[0] = low[0], node[1] = low[1], node[2] = low[stride], node[3] = low[stride + 1];
    node[4] = high[0], node[5] = high[1], node[6] = high[stride], node[7] = high[stride + 1];
}

static void write_tets(splitter *s, int y, int z)
{
    const uint64_t *row = kept_row(s, y, z);
    int32_t node[8], *to = s->tets->tet + 4 * (size_t)s->n_tet;
    for (int w = 0; w < s->kept.n_word; w++)
        for (uint64_t left = row[w]; left; left &= left - 1) {
            int x = 64 * w + __builtin_ctzll(left);
            const uint8_t *pattern = &pal_voxel_tets[(x + y + z) & 1][0][0];
            corners(s, x, y, z, node);
            for (int k = 0; k < 20; k++) to[k] = node[pattern[k]];
            to += 20;
        }
    s->n_tet = (to - s->tets->tet) / 4;
}

static void write_faces(splitter *s, int y, int z)
{
    int32_t node[8];
    for (int w = 0; w < s->kept.n_word; w++) {
        if (!kept_row(s, y, z)[w]) continue;
        for (int side = 0; side < 6; side++)
            for (uint64_t left = exposed_word(s, y, z, w, side); left; left &= left - 1) {
                int x = 64 * w + __builtin_ctzll(left);
                const uint8_t *corner = s->sides[(x + y + z) & 1][side];
                int32_t *to = s->tets->face + 3 * (size_t)s->n_face;
                corners(s, x, y, z, node);
                for (int k = 0; k < 6; k++) {
                    to[k] = node[corner[k]];
                    s->tets->on_surface[to[k]] = 1;
                }
                s->n_face += 2;
            }
    }
}

static pal_err split(splitter *s)
{
    const pal_voxels *v = s->voxels;
    size_t n_plane = ((size_t)v->n[0] + 1) * ((size_t)v->n[1] + 1);
    count_all(s);
    if (s->n_tet > INT32_MAX / 4 || s->n_node > INT32_MAX || s->n_face > INT32_MAX) return PAL_ERR_BUDGET;
    pal_tets *t = s->tets;
    *t = (pal_tets){.n_node = (int)s->n_node, .n_tet = (int)s->n_tet, .n_face = (int)s->n_face, .edge_m = v->edge_m};
    memcpy(t->origin_m, v->origin_m, sizeof t->origin_m);
    t->x = pal_voxels_array((size_t)s->n_node * 3 * sizeof *t->x);
    t->tet = pal_voxels_array((size_t)s->n_tet * 4 * sizeof *t->tet);
    t->face = pal_voxels_array((size_t)s->n_face * 3 * sizeof *t->face);
    pal_err err = t->x && t->tet && t->face ? PAL_ERR_OK : PAL_ERR_MEMORY;
    PAL_ZEROED(&err, t->on_surface, s->n_node);
    for (int k = 0; k < 2; k++) PAL_ARRAY(&err, s->plane[k], n_plane);
    if (err) return err;

    s->n_node = s->n_tet = s->n_face = 0;
    write_nodes(s, 0);
    for (int z = 0; z < v->n[2]; z++) {
        write_nodes(s, z + 1);
        for (int y = 0; y < v->n[1]; y++) {
            write_tets(s, y, z);
            write_faces(s, y, z);
        }
    }
    return PAL_ERR_OK;
}

pal_err pal_voxels_split(const pal_voxels *voxels, pal_tets *out)
{
    pal_tets tets = {0};
    splitter s = {.voxels = voxels, .tets = &tets};
    int wider[3] = {voxels->n[0] + 1, voxels->n[1], voxels->n[2]};
    pal_err err = pal_bits_create(wider, &s.kept);
    if (!err) {
        s.empty = calloc((size_t)s.kept.n_word, sizeof *s.empty);
        find_sides(s.sides);
        read_kind(voxels, &s.kept);
        err = s.empty ? split(&s) : PAL_ERR_MEMORY;
    }
    pal_bits_free(&s.kept);
    PAL_FREE(s.empty, s.plane[0], s.plane[1]);
    if (err)
        pal_tets_free(&tets);
    else
        *out = tets;
    return err;
}
