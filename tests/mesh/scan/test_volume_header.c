/* NRRD and MetaImage volumes, raw and compressed, in both byte orders and in patient axes of LPS and RAS, are the NIfTI
 * volume of the same labels; hostile headers give one sentence with file and line. */
#include "server/mesh/scan/label_volume.h"
#include "tests/check.h"

#include <zlib.h>

enum { NX = 4, NY = 3, NZ = 2, N = NX * NY * NZ, MAX = 4096 };

typedef struct file {
    uint8_t at[MAX];
    size_t n;
} file;

static int label_of(int i)
{
    return i * 37 % 300;
}

/* voxels as int16 behind a header; window bits of zlib: 0 raw, 15 zlib, 31 gzip */
static file make(const char *header, bool big, int window)
{
    file f = {{0}, strlen(header)};
    uint8_t voxel[2 * N];
    memcpy(f.at, header, f.n);
    for (int i = 0; i < N; i++)
        voxel[2 * i + !big] = (uint8_t)(label_of(i) >> 8), voxel[2 * i + big] = (uint8_t)label_of(i);
    if (!window) {
        memcpy(f.at + f.n, voxel, sizeof voxel);
        f.n += sizeof voxel;
        return f;
    }
    z_stream z;
    memset(&z, 0, sizeof z);
    deflateInit2(&z, 6, Z_DEFLATED, window, 8, Z_DEFAULT_STRATEGY);
    z.next_in = voxel, z.avail_in = sizeof voxel;
    z.next_out = f.at + f.n, z.avail_out = (uInt)(MAX - f.n);
    deflate(&z, Z_FINISH);
    f.n += z.total_out;
    deflateEnd(&z);
    return f;
}

static void put_float(uint8_t *to, double value)
{
    float f = (float)value;
    memcpy(to, &f, 4);
}

/* the same volume as NIfTI: an sform of voxels turned by a quarter about z, of 0.5, 2 and 3 mm */
static void read_nifti(pal_label_volume *v)
{
    static const double row[12] = {0, -2, 0, 10, 0.5, 0, 0, -20, 0, 0, 3, 30};
    file f = {{0}, 352 + 2 * N};
    f.at[0] = 348 & 255, f.at[1] = 348 >> 8;
    f.at[40] = 3, f.at[42] = NX, f.at[44] = NY, f.at[46] = NZ, f.at[70] = 4, f.at[72] = 16;
    put_float(f.at + 108, 352);
    f.at[123] = 2, f.at[254] = 1;
    for (int k = 0; k < 12; k++) put_float(f.at + 280 + 4 * k, row[k]);
    memcpy(f.at + 344, "n+1", 4);
    for (int i = 0; i < N; i++)
        f.at[352 + 2 * i] = (uint8_t)label_of(i), f.at[353 + 2 * i] = (uint8_t)(label_of(i) >> 8);
    REQUIRE(pal_label_volume_parse("same.nii", f.at, f.n, v, NULL) == PAL_ERR_OK);
}

static void check_same(const file *f, const char *name)
{
    pal_label_volume v = {0}, same = {0};
    pal_diagnostic diag = {{0}};
    read_nifti(&same);
    if (pal_label_volume_parse(name, f->at, f->n, &v, &diag)) fprintf(stderr, "%s\n", diag.text);
    REQUIRE(v.label != NULL);
    CHECK(!memcmp(v.n, same.n, sizeof v.n));
    CHECK(!memcmp(v.label, same.label, N * sizeof *v.label));
    /* the numbers of this sform are exact in float; metres are a rounding off */
    for (int k = 0; k < 12; k++) CHECK(fabs(v.to_m[k] - same.to_m[k]) < 1e-15);
    CHECK(!strcmp(v.axes, "RAS"));
    pal_label_volume_free(&v);
    pal_label_volume_free(&same);
}

#define NRRD(SPACE, ENDIAN, ENCODING, DIRECTIONS)                                                                      \
    "NRRD0004\n# Complete NRRD file format specification at:\n# http://teem.sourceforge.net/nrrd/format.html\n"        \
    "type: short\ndimension: 3\nspace: " SPACE "\nsizes: 4 3 2\nspace directions: " DIRECTIONS                         \
    "\nkinds: domain domain domain\nendian: " ENDIAN "\nencoding: " ENCODING "\nSegment0_ID:=Segment_1\n\n"
#define LPS "(0,-0.5,0) (2,0,0) (0,0,3)\nspace origin: (-10,20,30)"
#define RAS "(0,0.5,0) (-2,0,0) (0,0,3)\nspace origin: (10,-20,30)"
#define LAS "(0, 0.5, 0) (2, 0, 0) (0, 0, 3)\nspace origin: (-10, -20, 30)"

static void nrrd_of_every_space_encoding_and_order_is_the_nifti(void)
{
    file f = make(NRRD("left-posterior-superior", "little", "gzip", LPS), false, 31);
    check_same(&f, "slicer.seg.nrrd");
    f = make(NRRD("LPS", "big", "raw", LPS), true, 0);
    check_same(&f, "big.nrrd");
    f = make(NRRD("right-anterior-superior", "little", "raw", RAS), false, 0);
    check_same(&f, "ras.nrrd");
    f = make(NRRD("LAS", "big", "gz", LAS), true, 31);
    check_same(&f, "las.nrrd");
}

#define MHA(ORDER, PACKED, LAST)                                                                                       \
    "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = " ORDER "\nCompressedData = " PACKED   \
    "\nTransformMatrix = 0 -1 0 1 0 0 0 0 1\nOffset = -10 20 30\nCenterOfRotation = 0 0 0\n"                           \
    "AnatomicalOrientation = RAI\nElementSpacing = 0.5 2 3\nDimSize = 4 3 2\nElementType = MET_SHORT\n"                \
    "ElementDataFile = " LAST "\n"

static void metaimage_plain_and_compressed_is_the_nifti(void)
{
    file f = make(MHA("False", "False", "LOCAL"), false, 0);
    check_same(&f, "plain.mha");
    f = make(MHA("True", "False", "LOCAL"), true, 0);
    check_same(&f, "big.mha");
    f = make(MHA("False", "True", "LOCAL"), false, 15);
    check_same(&f, "packed.mha");
}

static void refused(const char *header, const char *sentence)
{
    file f = make(header, false, 0);
    pal_label_volume v = {0};
    pal_diagnostic diag = {{0}};
    CHECK_INT(pal_label_volume_parse("x", f.at, f.n, &v, &diag), PAL_ERR_REFUSED);
    check_count++;
    if (!strstr(diag.text, sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, sentence);
    pal_label_volume_free(&v);
}

static void hostile_headers_are_refused_with_their_line(void)
{
    refused(NRRD("scanner", "little", "raw", LPS), "x: line 6: space \"scanner\"");
    refused(NRRD("LPS", "middle", "raw", LPS), "x: line 11: endian \"middle\"");
    refused(NRRD("LPS", "little", "bzip2", LPS), "encoding \"bzip2\" is not raw or gzip");
    refused(NRRD("LPS", "little", "raw", "(1,0,0) (0,1,0)"), "is \"(1,0,0) (0,1,0)\", not 9 numbers");
    refused(NRRD("LPS", "little", "raw", "(1,0,0) (0,1,0) (0,nan,0)"), "flat or not finite");
    refused(NRRD("LPS", "little", "raw", "(1,0,0) (0,1,0) (1,0,0)"), "flat or not finite");
    refused("NRRD0004\ntype: block\n\n", "x: line 2: voxel type \"block\" is not read");
    refused("NRRD0004\ndimension: 4\n\n", "x: line 2: 4 axes, three are read");
    refused("NRRD0004\nsizes: 4 3 2\n\n", "sizes stand before dimension");
    refused("NRRD0004\ndimension: 3\nsizes: 4 -3 2\n\n", "x: line 3: axis 2 has -3 voxels");
    refused("NRRD0004\ndata file: a.raw\n\n", "x: line 2: the voxels are in another file, a.raw");
    refused("NRRD0004\nbyte skip: -1\n\n", "byte skip -1 is not read");
    refused("NRRD0004\nnonsense\n\n", "\"nonsense\" is not KEY: VALUE");
    refused("NRRD0004\ntype: short\n\n", "the header ends without sizes");
    refused(MHA("False", "False", "a.raw"), "the voxels are in another file, a.raw");
    refused("ObjectType = Image\nNDims = 2\n", "x: line 2: 2 axes, 3 is read");
    refused("ObjectType = Image\nElementType = MET_STRING\n", "voxel type \"MET_STRING\" is not read");
    refused("ObjectType = Image\nNDims = 3\nElementDataFile = LOCAL\n", "the header ends without DimSize");
    refused("ObjectType = Image\nHeaderSize = 348\n", "348 bytes before the voxels (HeaderSize), 0 is read");
    refused("ObjectType = Image\nElementNumberOfChannels = 3\n", "3 values in a voxel, 1 is read");
}

static void a_file_that_ends_early_is_refused(void)
{
    static const char *const header[] = {NRRD("LPS", "little", "raw", LPS), MHA("False", "False", "LOCAL")};
    for (int k = 0; k < 2; k++) {
        const file f = make(header[k], false, 0);
        for (size_t n = 12; n < f.n; n++) {
            pal_label_volume v = {0};
            uint8_t *copy = malloc(n);
            REQUIRE(copy != NULL);
            memcpy(copy, f.at, n);
            CHECK_INT(pal_label_volume_parse("x", copy, n, &v, NULL), PAL_ERR_REFUSED);
            free(copy);
        }
    }
}

int main(void)
{
    RUN(nrrd_of_every_space_encoding_and_order_is_the_nifti);
    RUN(metaimage_plain_and_compressed_is_the_nifti);
    RUN(hostile_headers_are_refused_with_their_line);
    RUN(a_file_that_ends_early_is_refused);
    return check_report();
}
