/* Header, JSON chunk, binary chunk; each chunk is padded to 4 bytes, and so is each part of the binary one. */
#include "server/mesh/files/glb_file.h"

#include "server/base/heap.h"
#include "server/base/json_members.h"
#include "server/mesh/files/file_bytes.h"

#include <math.h>

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "files are written in the host's order");

enum { HEADER = 12, CHUNK = 8 };
/* numbers of the specification: magic and types of chunks, component types, targets of buffer views */
enum { GLTF = 0x46546C67, JSON_CHUNK = 0x4E4F534A, BIN_CHUNK = 0x004E4942 };
enum { FLOAT32 = 5126, UINT32 = 5125, VERTICES = 34962, INDICES = 34963, NO_TARGET = 0 };

typedef struct glb {
    cJSON *root, *views, *accessors;
    const void **bytes; /* of the binary chunk, in its order [n] */
    size_t *n_byte;
    int n;
    uint64_t at; /* bytes of the binary chunk so far */
    bool failed; /* no memory */
} glb;

static size_t padded(uint64_t n)
{
    return (size_t)((n + 3) & ~(uint64_t)3);
}

/* the number of a new buffer view */
static int add_view(glb *g, const void *bytes, size_t n_byte, int target)
{
    g->failed = g->failed || !PAL_GROW(g->bytes, g->n) || !PAL_GROW(g->n_byte, g->n);
    if (g->failed) return 0;
    g->bytes[g->n] = bytes, g->n_byte[g->n] = n_byte;
    cJSON_AddItemToArray(g->views, PAL_JSON({"buffer", JSON_NUMBER(0)}, {"byteOffset", JSON_NUMBER(g->at)},
                                            {"byteLength", JSON_NUMBER(n_byte)},
                                            {"target", target ? JSON_NUMBER(target) : NULL}));
    g->at += padded(n_byte);
    return g->n++;
}

/* the number of a new accessor; low, high: of positions, else NULL [3] */
static int add_accessor(glb *g, const void *bytes, size_t n, int n_component, int component, const double *low,
                        const double *high)
{
    static const char *const type[] = {NULL, "SCALAR", "VEC2", "VEC3"};
    const int view = add_view(g, bytes, 4 * n * (size_t)n_component, component == FLOAT32 ? VERTICES : INDICES);
    cJSON_AddItemToArray(g->accessors,
                         PAL_JSON({"bufferView", JSON_NUMBER(view)}, {"componentType", JSON_NUMBER(component)},
                                  {"count", JSON_NUMBER(n)}, {"type", JSON_TEXT(type[n_component])},
                                  {"min", low ? cJSON_CreateDoubleArray(low, 3) : NULL},
                                  {"max", high ? cJSON_CreateDoubleArray(high, 3) : NULL}));
    return cJSON_GetArraySize(g->accessors) - 1;
}

static int add_positions(glb *g, const pal_glb_mesh *m)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < 3 * (size_t)m->n_vertex; i++) {
        low[i % 3] = fmin(low[i % 3], (double)m->x[i]);
        high[i % 3] = fmax(high[i % 3], (double)m->x[i]);
    }
    return add_accessor(g, m->x, (size_t)m->n_vertex, 3, FLOAT32, low, high);
}

static cJSON *add_mesh(glb *g, const pal_glb_mesh *m)
{
    const size_t n = (size_t)m->n_vertex;
    const int x = add_positions(g, m), normal = add_accessor(g, m->normal, n, 3, FLOAT32, NULL, NULL);
    const int uv = m->uv ? add_accessor(g, m->uv, n, 2, FLOAT32, NULL, NULL) : -1;
    cJSON *list = cJSON_CreateArray();
    for (int k = 0; k < m->n_part; k++) {
        cJSON *attributes = PAL_JSON({"POSITION", JSON_NUMBER(x)}, {"NORMAL", JSON_NUMBER(normal)},
                                     {"TEXCOORD_0", m->uv ? JSON_NUMBER(uv) : NULL});
        const int tri = add_accessor(g, m->part[k].tri, 3 * (size_t)m->part[k].n_tri, 1, UINT32, NULL, NULL);
        cJSON_AddItemToArray(list, PAL_JSON({"attributes", attributes}, {"indices", JSON_NUMBER(tri)},
                                            {"material", JSON_NUMBER(m->part[k].material)}, {"mode", JSON_NUMBER(4)}));
    }
    return PAL_JSON({"name", JSON_TEXT(m->name)}, {"primitives", list});
}

/* sRGB (IEC 61966-2-1) to linear, as glTF has factors */
static double linear_of(uint8_t value)
{
    const double c = value / 255.0;
    return c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
}

/* image: number of its texture, -1: none. Shown from both sides, since a surface may be open */
static cJSON *material_json(const pal_glb_material *m, int image)
{
    double rgba[4] = {1, 1, 1, 1};
    for (int c = 0; c < 3 && image < 0; c++) rgba[c] = linear_of(m->rgb[c]);
    cJSON *texture = image < 0 ? NULL : PAL_JSON({"index", JSON_NUMBER(image)});
    cJSON *look = PAL_JSON({"baseColorFactor", cJSON_CreateDoubleArray(rgba, 4)}, {"baseColorTexture", texture},
                           {"metallicFactor", JSON_NUMBER(0)}, {"roughnessFactor", JSON_NUMBER(0.5)});
    return PAL_JSON({"name", JSON_TEXT(m->name)}, {"pbrMetallicRoughness", look}, {"doubleSided", JSON_BOOL(true)});
}

static void add_materials(glb *g, const pal_glb_scene *s)
{
    cJSON *materials = cJSON_CreateArray(), *images = cJSON_CreateArray(), *textures = cJSON_CreateArray();
    for (int k = 0; k < s->n_material; k++) {
        const pal_image *image = s->material[k].image;
        const int n = image ? cJSON_GetArraySize(images) : -1;
        cJSON_AddItemToArray(materials, material_json(&s->material[k], n));
        if (!image) continue;
        const int view = add_view(g, image->bytes, image->n_byte, NO_TARGET);
        cJSON_AddItemToArray(images, PAL_JSON({"bufferView", JSON_NUMBER(view)},
                                              {"mimeType", JSON_TEXT(pal_image_type(image->bytes, image->n_byte))}));
        cJSON_AddItemToArray(textures, PAL_JSON({"source", JSON_NUMBER(n)}));
    }
    PAL_JSON_ADD(g->root, {"materials", materials});
    /* the format has no empty lists */
    if (cJSON_GetArraySize(images) > 0)
        PAL_JSON_ADD(g->root, {"images", images}, {"textures", textures});
    else
        cJSON_Delete(images), cJSON_Delete(textures);
}

/* quaternion x y z w of the shortest rotation that takes `up` to y */
static void turn_up(const double up[3], double q[4])
{
    q[0] = -up[2], q[1] = 0, q[2] = up[0], q[3] = 1 + up[1];
    /* straight down: half a turn about x */
    if (q[3] < 1e-12) q[0] = 1, q[2] = 0, q[3] = 0;
    const double length = sqrt(q[0] * q[0] + q[2] * q[2] + q[3] * q[3]);
    for (int c = 0; c < 4; c++) q[c] /= length;
}

static void add_nodes(glb *g, const pal_glb_scene *s)
{
    double q[4];
    const int first[] = {0};
    cJSON *nodes = cJSON_CreateArray(), *children = cJSON_CreateArray();
    turn_up(s->up, q);
    cJSON_AddItemToArray(nodes, PAL_JSON({"name", JSON_TEXT(s->name)}, {"rotation", cJSON_CreateDoubleArray(q, 4)},
                                         {"children", children}));
    for (int k = 0; k < s->n_mesh; k++) {
        cJSON_AddItemToArray(children, JSON_NUMBER(k + 1));
        cJSON_AddItemToArray(nodes, PAL_JSON({"name", JSON_TEXT(s->mesh[k].name)}, {"mesh", JSON_NUMBER(k)}));
    }
    cJSON *scene = PAL_JSON({"name", JSON_TEXT(s->name)}, {"nodes", cJSON_CreateIntArray(first, 1)},
                            {"extras", PAL_JSON({"time_s", JSON_NUMBER(s->time_s)})});
    cJSON *scenes = cJSON_CreateArray();
    cJSON_AddItemToArray(scenes, scene);
    PAL_JSON_ADD(g->root, {"scene", JSON_NUMBER(0)}, {"scenes", scenes}, {"nodes", nodes});
}

static void describe(glb *g, const pal_glb_scene *s)
{
    g->root = PAL_JSON({"asset", PAL_JSON({"version", JSON_TEXT("2.0")}, {"generator", JSON_TEXT("palpate")})});
    g->views = cJSON_CreateArray(), g->accessors = cJSON_CreateArray();
    cJSON *meshes = cJSON_CreateArray(), *buffers = cJSON_CreateArray();
    add_nodes(g, s);
    for (int k = 0; k < s->n_mesh; k++) cJSON_AddItemToArray(meshes, add_mesh(g, &s->mesh[k]));
    add_materials(g, s);
    cJSON_AddItemToArray(buffers, PAL_JSON({"byteLength", JSON_NUMBER(g->at)}));
    PAL_JSON_ADD(g->root, {"meshes", meshes}, {"accessors", g->accessors}, {"bufferViews", g->views},
                 {"buffers", buffers});
}

static void put_words(FILE *file, uint32_t a, uint32_t b)
{
    const uint32_t word[] = {a, b};
    fwrite(word, sizeof word, 1, file);
}

static pal_err write_chunks(const char *path, const glb *g, const char *json, pal_diagnostic *diag)
{
    static const char zeros[4], blanks[] = "   ";
    const size_t n_json = strlen(json);
    const uint64_t total = HEADER + 2 * CHUNK + padded(n_json) + g->at;
    pal_file_out out;
    if (total > UINT32_MAX)
        return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "%s: %.1f GB, a glTF file has at most 4.3", path,
                                  1e-9 * (double)total);
    PAL_TRY(pal_file_begin(&out, path, diag));
    put_words(out.file, GLTF, 2);
    fwrite(&(uint32_t){(uint32_t)total}, 4, 1, out.file);
    put_words(out.file, (uint32_t)padded(n_json), JSON_CHUNK);
    fputs(json, out.file);
    fwrite(blanks, 1, padded(n_json) - n_json, out.file);
    put_words(out.file, (uint32_t)g->at, BIN_CHUNK);
    for (int k = 0; k < g->n; k++) {
        fwrite(g->bytes[k], 1, g->n_byte[k], out.file);
        fwrite(zeros, 1, padded(g->n_byte[k]) - g->n_byte[k], out.file);
    }
    return pal_file_end(&out, diag);
}

pal_err pal_mesh_write_glb(const char *path, const pal_glb_scene *scene, pal_diagnostic *diag)
{
    glb g = {0};
    for (int k = 0; k < scene->n_mesh; k++)
        for (int p = 0; p == 0 || p < scene->mesh[k].n_part; p++)
            if (scene->mesh[k].n_vertex < 1 || scene->mesh[k].n_part < 1 || scene->mesh[k].part[p].n_tri < 1)
                return PAL_REFUSE(diag, "%s: mesh %.60s has no triangles", path, scene->mesh[k].name);
    if (scene->n_mesh < 1) return PAL_REFUSE(diag, "%s: there is no mesh to write", path);
    describe(&g, scene);
    char *json = g.root && !g.failed ? cJSON_PrintUnformatted(g.root) : NULL;
    pal_err err = json ? write_chunks(path, &g, json, diag)
                       : pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for its description", path);
    cJSON_free(json);
    cJSON_Delete(g.root);
    return PAL_FREED(err, g.bytes, g.n_byte);
}
