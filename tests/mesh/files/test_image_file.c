/* Images by their first bytes and their size, and the image of a material: what is taken, and the sentence of every
 * refusal. */
#include "server/mesh/files/image_file.h"
#include "server/mesh/files/material_file.h"
#include "tests/check.h"

enum { ROOM = 64 };

static size_t make_png(uint8_t out[ROOM], uint32_t width, uint32_t height)
{
    static const uint8_t head[16] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n', 0, 0, 0, 13, 'I', 'H', 'D', 'R'};
    memset(out, 0, ROOM);
    memcpy(out, head, sizeof head);
    for (int k = 0; k < 4; k++)
        out[16 + k] = (uint8_t)(width >> (24 - 8 * k)), out[20 + k] = (uint8_t)(height >> (24 - 8 * k));
    return 45;
}

/* a comment segment, padding between markers, then a frame header of the given kind */
static size_t make_jpeg(uint8_t out[ROOM], uint8_t frame, uint32_t width, uint32_t height)
{
    const uint8_t bytes[] = {0xFF,
                             0xD8,
                             0xFF,
                             0xFE,
                             0,
                             5,
                             'a',
                             'b',
                             'c',
                             0xFF,
                             0xFF,
                             0xFF,
                             frame,
                             0,
                             17,
                             8,
                             (uint8_t)(height >> 8),
                             (uint8_t)height,
                             (uint8_t)(width >> 8),
                             (uint8_t)width,
                             3};
    memset(out, 0, ROOM);
    memcpy(out, bytes, sizeof bytes);
    return 40;
}

/* parses a heap copy of exactly n bytes, so that the address sanitizer sees every read beyond it */
static pal_err parse(const uint8_t *bytes, size_t n, pal_image *image, pal_diagnostic *diag)
{
    uint8_t *copy = malloc(n + !n);
    if (!copy) return PAL_ERR_MEMORY;
    memcpy(copy, bytes, n);
    pal_err err = pal_image_parse("i.png", copy, n, image, diag);
    free(copy);
    return err;
}

static void png_and_jpeg_give_their_size(void)
{
    uint8_t bytes[ROOM];
    for (int k = 0; k < 3; k++) {
        pal_image image = {0};
        size_t n = k == 0 ? make_png(bytes, 8192, 3) : make_jpeg(bytes, k == 1 ? 0xC0 : 0xC2, 8192, 3);
        REQUIRE(!parse(bytes, n, &image, NULL));
        CHECK_INT(image.width, 8192);
        CHECK_INT(image.height, 3);
        CHECK_INT(image.n_byte, n);
        CHECK(!memcmp(image.bytes, bytes, n));
        CHECK_TEXT(image.ending, k ? ".jpg" : ".png");
        CHECK_TEXT(pal_image_type(bytes, n), k ? "image/jpeg" : "image/png");
        /* every shorter piece is refused, and none is read beyond its end */
        pal_image_free(&image);
        for (size_t cut = 0; cut < (k ? 20u : 33u); cut++) CHECK_INT(parse(bytes, cut, &image, NULL), PAL_ERR_REFUSED);
    }
}

static void other_images_have_their_sentence(void)
{
    uint8_t bytes[ROOM];
    pal_image image = {0};
    pal_diagnostic diag = {""};
    CHECK_INT(parse((const uint8_t *)"GIF89a, and more", 16, &image, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "i.png: byte 0: neither a PNG nor a JPEG image");
    CHECK_INT(parse(bytes, make_png(bytes, 8193, 2), &image, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "i.png: 8193 x 2 pixels, 1 to 8192 a side are shown");
    CHECK_INT(parse(bytes, make_png(bytes, 5, 0), &image, &diag), PAL_ERR_REFUSED);
    CHECK_INT(parse(bytes, make_jpeg(bytes, 0xC0, 0, 9), &image, &diag), PAL_ERR_REFUSED);
    /* pixels, or tables for ever, before a size */
    CHECK_INT(parse(bytes, make_jpeg(bytes, 0xDA, 5, 9), &image, &diag), PAL_ERR_REFUSED);
    CHECK_INT(parse(bytes, make_jpeg(bytes, 0xC4, 5, 9), &image, &diag), PAL_ERR_REFUSED);
    uint8_t *large = calloc(PAL_IMAGE_MAX_BYTE + 1, 1);
    REQUIRE(large);
    make_png(large, 5, 5);
    CHECK_INT(pal_image_parse("i.png", large, PAL_IMAGE_MAX_BYTE + 1, &image, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "i.png: 16777217 bytes, an image has at most 16777216");
    free(large);
}

static void a_material_names_its_image(void)
{
    static const struct {
        const char *text, *material, *image, *sentence; /* image NULL: refused */
    } c[] = {
        {"newmtl a\nKd 1 1 1\nmap_Kd a.png\n", "", "a.png", ""},
        {"# c\r\nnewmtl a\r\nmap_Kd a.png\r\nnewmtl b b\r\n\tmap_kd  my skin.jpg \r\n", "b b", "my skin.jpg", ""},
        {"newmtl a\nmap_Kd a.png\n", "b", "", ""},
        {"newmtl a\nKd 1 1 1\n", "a", "", ""},
        {"", "", "", ""},
        {"map_Kd ../a.png\n", "", NULL, "m.mtl: line 1: map_Kd: '../a.png' is not the plain name of a file"},
        {"\nmap_Kd /etc/passwd\n", "", NULL, "m.mtl: line 2: map_Kd: "},
        {"map_Kd C:\\\\a.png\n", "", NULL, "is not the plain name"},
        {"map_Kd .hidden\n", "", NULL, "is not the plain name"},
        {"map_Kd -s 1 1 1 a.png\n", "", NULL, "options are not read"},
        {"map_Kd a\tb.png\n", "", NULL, "printable"},
    };
    for (size_t k = 0; k < sizeof c / sizeof *c; k++) {
        char image[128] = "?";
        pal_diagnostic diag = {""};
        pal_err err =
            pal_material_image("m.mtl", (const uint8_t *)c[k].text, strlen(c[k].text), c[k].material, image, &diag);
        CHECK_INT(err, c[k].image ? PAL_ERR_OK : PAL_ERR_REFUSED);
        if (c[k].image) CHECK_TEXT(image, c[k].image);
        if (!strstr(diag.text, c[k].sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, c[k].sentence);
    }
    char name[200], image[128];
    snprintf(name, sizeof name, "map_Kd %0150d.png\n", 7);
    CHECK_INT(pal_material_image("m.mtl", (const uint8_t *)name, strlen(name), "", image, NULL), PAL_ERR_REFUSED);
}

/* 8192 x 8192 pixels in all are the most of one image and of several */
static void the_images_of_a_body_are_limited_together(void)
{
    const pal_image one = {.n_byte = PAL_IMAGE_MAX_BYTE, .width = 8192, .height = 8192};
    const pal_image half[3] = {{.n_byte = 8 << 20, .width = 8192, .height = 4096},
                               {.n_byte = 8 << 20, .width = 4096, .height = 8192},
                               {.n_byte = 1, .width = 1, .height = 1}};
    pal_image many[PAL_IMAGES_MAX + 1] = {{0}};
    pal_diagnostic diag = {""};
    CHECK_INT(pal_images_check(&one, 1, &diag), 0);
    CHECK_INT(pal_images_check(half, 2, &diag), 0);
    CHECK_INT(pal_images_check(many, PAL_IMAGES_MAX, &diag), 0);
    CHECK_INT(pal_images_check(half, 3, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "3 images with together 16777217 bytes, those of a body have at most 16777216");
    many[0] = one, many[1] = half[2], many[0].n_byte = 0;
    CHECK_INT(pal_images_check(many, 2, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "2 images with together 67108865 pixels, those of a body have at most 67108864");
    CHECK_INT(pal_images_check(many, PAL_IMAGES_MAX + 1, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "9 images, a body shows at most 8");
}

int main(void)
{
    RUN(the_images_of_a_body_are_limited_together);
    RUN(png_and_jpeg_give_their_size);
    RUN(other_images_have_their_sentence);
    RUN(a_material_names_its_image);
    return check_report();
}
