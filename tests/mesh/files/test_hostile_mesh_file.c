/* Hostile surface files give one sentence with name and place, and take little memory. */
#include "tests/fixtures/mesh_bytes.h"
#include "tests/fixtures/random.h"

/* the largest single request for memory, seen through the linker's --wrap */
static size_t largest_request;
void *__real_malloc(size_t n);
void *__real_calloc(size_t n, size_t size);
void *__real_realloc(void *p, size_t n);
void *__wrap_malloc(size_t n);
void *__wrap_calloc(size_t n, size_t size);
void *__wrap_realloc(void *p, size_t n);

static void saw(size_t n)
{
    if (n > largest_request) largest_request = n;
}
void *__wrap_malloc(size_t n)
{
    saw(n);
    return __real_malloc(n);
}
void *__wrap_calloc(size_t n, size_t size)
{
    saw(n * size);
    return __real_calloc(n, size);
}
void *__wrap_realloc(void *p, size_t n)
{
    saw(n);
    return __real_realloc(p, n);
}

static int n_hostile;

/* must be refused with one sentence that has the name and the place, within 64 times the file's size (and 64 KiB) */
static void check_refused(const char *name, const void *bytes, size_t n)
{
    pal_surface s = {0};
    pal_diagnostic diag = {{0}};
    largest_request = 0;
    pal_err err = parse(name, bytes, n, &s, NULL, &diag);
    check_count++;
    n_hostile++;
    if (err == PAL_ERR_OK) CHECK_FAIL("%s kind %d was accepted", name, n_hostile);
    size_t n_name = strlen(name);
    const char *rest = diag.text + n_name + 2;
    char unit[8];
    long long at;
    bool placed = strncmp(diag.text, name, n_name) == 0 && sscanf(rest, "%7s %lld:", unit, &at) == 2 &&
                  (!strcmp(unit, "line") || !strcmp(unit, "byte")) && at >= 0 && at <= (long long)n + 1;
    if (!placed || strchr(diag.text, '\n')) CHECK_FAIL("%s kind %d: \"%s\"", name, n_hostile, diag.text);
    CHECK_LE((double)largest_request, 64.0 * (double)n + 65536);
    CHECK(s.x == NULL && s.tri == NULL);
}

static void check_all_refused(const char *name, const char *const *text, int n_text)
{
    n_hostile = 0;
    for (int k = 0; k < n_text; k++) check_refused(name, text[k], strlen(text[k]));
    check_refused(name, "", 0);
    uint8_t noise[5000];
    uint64_t seed = 7;
    for (size_t k = 0; k < sizeof noise; k++) noise[k] = (uint8_t)random_below(&seed, 256);
    check_refused(name, noise, sizeof noise);
    memset(noise, 0, sizeof noise);
    check_refused(name, noise, sizeof noise);
    memset(noise, '\n', sizeof noise);
    check_refused(name, noise, sizeof noise);
    CHECK(n_hostile >= 13);
}

static void hostile_obj_is_refused_with_its_line(void)
{
    static const char *const text[] = {
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n",                    /* index out of range          */
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n",                   /* before the first            */
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",                    /* zero                        */
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n", /* beyond every integer      */
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4000000000\n",           /* beyond an int32             */
        "v 0 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n",                      /* two numbers                 */
        "v 0 0 0\nv 1 0 0\nv 0 1 zero\nf 1 2 3\n",                 /* a word                      */
        "v nan nan nan\nv nan 0 0\nv 0 nan 0\nf 1 2 3\n",          /* not a number                */
        "v 0 0 0\nv inf 0 0\nv 0 1 0\nf 1 2 3\n",                  /* infinite                    */
        "v 0 0 0\nv 1e999 0 0\nv 0 1 0\nf 1 2 3\n",                /* infinite by its exponent    */
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2",                        /* cut off in the face         */
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf\n",                          /* no corners                  */
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/2/3/4x 2 3\n",             /* corner with a letter        */
        "v 0 0 0\nv 1 0 0\nv 0 1 0\n",                             /* no face                     */
        "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",                    /* no area                     */
        "# nothing\n",
        "v",
        "f",
        "v 0 0 0\n\x01\x02\x03\nf 1 1 1",
        "f 1 2 3\n",
        "\\\n\\\n\\\n",
        "v 0 0 0\\"};
    check_all_refused("bad.obj", text, sizeof text / sizeof *text);
    pal_diagnostic diag = {{0}};
    pal_surface s = {0};
    parse("bad.obj", text[0], strlen(text[0]), &s, NULL, &diag);
    CHECK_TEXT(diag.text, "bad.obj: line 4: a face uses vertex index 3 (from 0) of only 3 vertices");
    parse("bad.obj", text[6], strlen(text[6]), &s, NULL, &diag);
    CHECK_TEXT(diag.text, "bad.obj: line 3: a position needs three numbers, found 'zero'");
}

static void hostile_off_is_refused_with_its_line(void)
{
    static const char *const text[] = {"OFF\n",
                                       "OFF\n3\n",
                                       "OFF\n-3 1 0\n",
                                       "OFF\nx y z\n",
                                       "OFF\n4000000000 1 0\n0 0 0\n",
                                       "OFF\n3 4000000000 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
                                       "OFF\n9223372036854775807 1 0\n",
                                       "OFF\n99999999999999999999999 1 0\n",
                                       "OFF\n3 1 0\n0 0 0\n1 0 0\n",
                                       "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n",
                                       "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n",
                                       "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
                                       "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n",
                                       "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n",
                                       "OFF\n3 1 0\nnan 0 0\n1 nan 0\n0 1 inf\n3 0 1 2\n",
                                       "OFF\n3 1 0\n0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
                                       "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n",
                                       "OFF BINARY\n3 1 0\n",
                                       "4OFF\n3 1 0\n",
                                       "OFF\n0 0 0\n"};
    check_all_refused("bad.off", text, sizeof text / sizeof *text);
}

#define PLY_HEAD(FORMAT, N_VERTEX, N_FACE)                                                                             \
    "ply\nformat " FORMAT " 1.0\nelement vertex " N_VERTEX "\nproperty float x\nproperty float y\nproperty float z\n"  \
    "element face " N_FACE "\nproperty list uchar int vertex_indices\nend_header\n"
#define LITTLE "binary_little_endian"

static void hostile_ply_is_refused_with_its_place(void)
{
    static const char *const text[] = {
        "ply\n",
        "ply\nformat ascii 1.0\n",
        "ply\nformat ascii 2.0\nend_header\n",
        "ply\nformat binary 1.0\nend_header\n",
        "ply\nend_header\n",
        "ply\nformat ascii 1.0\nend_header\n",
        "ply\nformat ascii 1.0\nproperty float x\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex -1\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex many\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty quad x\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty list float int x\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0\n0 0\n0 0\n3 0 1 2\n",
        PLY_HEAD("ascii", "3", "1") "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
        PLY_HEAD("ascii", "3", "1") "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n",
        PLY_HEAD("ascii", "3", "1") "0 0 0\n1 0 0\n0 1 0\n3 0 1\n",
        PLY_HEAD("ascii", "3", "1") "0 0 0\n1 0 0\n",
        PLY_HEAD("ascii", "3", "1") "0 0 0\n1 0 0\n0 1 0\n3 0 1 1.5\n",
        PLY_HEAD("ascii", "3", "1") "0 0 0\n1 0 0\n0 1 0\n1e9 0 1 2\n",
        PLY_HEAD("ascii", "3", "1") "nan nan nan\n1 0 0\n0 1 0\n3 0 1 2\n",
        PLY_HEAD("ascii", "3", "1") "0 0 0\n1 0 0\n0 one 0\n3 0 1 2\n",
        PLY_HEAD("ascii", "4000000000", "1") "0 0 0\n",
        PLY_HEAD("ascii", "3", "999999999999999999") "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        PLY_HEAD("ascii", "9999999999999999999999", "1") "0 0 0\n",
        PLY_HEAD("ascii", "0", "0"),
        PLY_HEAD(LITTLE, "4000000000", "1") "0123456789ab",
        PLY_HEAD(LITTLE, "1", "4000000000") "0123456789ab\x03",
        PLY_HEAD(LITTLE, "1", "1") "0123456789ab\xFF",
        PLY_HEAD(LITTLE, "1", "1") "0123456789",
        PLY_HEAD(LITTLE, "2", "1") "0123456789ab",
        PLY_HEAD(LITTLE, "1", "1") "0123456789ab\x03"
                                   "0123456789ab",
        PLY_HEAD(LITTLE, "1", "1") "0123456789ab\x03"
                                   "0123",
        "ply\nformat ascii 1.0\nelement nothing 999999999999999999\nelement vertex 0\nproperty float x\nproperty float "
        "y\n"
        "property float z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n"};
    check_all_refused("bad.ply", text, sizeof text / sizeof *text);
    pal_diagnostic diag = {{0}};
    pal_surface s = {0};
    const char *cut = PLY_HEAD(LITTLE, "1", "1") "0123456789ab\x03"
                                                 "0123"
                                                 "0123";
    parse("cut.ply", cut, strlen(cut), &s, NULL, &diag);
    char wanted[100];
    snprintf(wanted, sizeof wanted, "cut.ply: byte %zu: a list of 3 entries, but only 8 bytes follow", strlen(cut) - 9);
    CHECK_TEXT(diag.text, wanted);
}

static void hostile_stl_is_refused_with_its_place(void)
{
    static const char *const text[] = {
        "solid",
        "solid x\n",
        "solid x\nendsolid x\n",
        "solid x\nfacet normal 0 0 1\n",
        "solid x\nfacet normal 0 0 1\nouter loop\n",
        "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n",
        "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 "
        "1\nendloop\nendfacet\nendsolid\n",
        "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 zero\n",
        "solid x\nfacet normal 0 0 1\nouter ring\n",
        "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nendfacet\n",
        "solid x\nfacet normal 0 0 1\nouter loop\nvertex nan 0 0\nvertex 1 0 0\nvertex 0 1 "
        "0\nendloop\nendfacet\nendsolid\n",
        "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0 0 0\nvertex 0 1 "
        "0\nendloop\nendfacet\nendsolid\n",
        "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 "
        "0\nendloop\nendfacet\nrubbish\n",
        "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"};
    check_all_refused("bad.stl", text, sizeof text / sizeof *text);
    /* binary: each head of 84 bytes with a count, and then some bytes */
    static const struct {
        uint32_t claimed;
        size_t n_byte;
    } cut[] = {{0, 84}, {1, 84}, {1, 133}, {4, 84 + 150}, {4294967295u, 84 + 50}, {85899345u, 84 + 100}, {7, 40}};
    for (size_t k = 0; k < sizeof cut / sizeof *cut; k++) {
        uint8_t bytes[400] = "solid x";
        memset(bytes + 8, 0, sizeof bytes - 8);
        memcpy(bytes + 80, &cut[k].claimed, 4);
        check_refused("cut.stl", bytes, cut[k].n_byte);
    }
    uint8_t nans[84 + 50];
    memset(nans, 0xFF, sizeof nans);
    nans[80] = 1, nans[81] = nans[82] = nans[83] = 0;
    check_refused("nan.stl", nans, sizeof nans);
}

int main(void)
{
    RUN(hostile_obj_is_refused_with_its_line);
    RUN(hostile_off_is_refused_with_its_line);
    RUN(hostile_ply_is_refused_with_its_place);
    RUN(hostile_stl_is_refused_with_its_place);
    return check_report();
}
