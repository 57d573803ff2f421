/* The images of an OBJ file: mtllib and usemtl lead to map_Kd, whose file lies beside the OBJ file. */
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/material_file.h"
#include "server/scene/scene_import.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { PATH = 1200, MATERIAL_MAX_BYTE = 1 << 20 };

/* the path of a file that lies beside another; false: it is too long */
static bool beside(const char *path, const char *name, char out[PATH])
{
    const char *slash = strrchr(path, '/');
    const int n = slash ? (int)(slash - path) + 1 : 0;
    return snprintf(out, PATH, "%.*s%s", n, path, name) < PATH;
}

/* the images that the materials name, and the number of the image of each material, -1: none */
typedef struct image_list {
    int n, of[PAL_MATERIAL_MAX];
    pal_material_name name[PAL_MATERIAL_MAX], absent; /* absent: the first one whose file is not there, "": none */
} image_list;

static int find_name(const image_list *list, const pal_material_name name)
{
    int k = 0;
    while (k < list->n && strcmp(list->name[k], name)) k++;
    return k;
}

/* reads the file of materials */
static pal_err list_images(const char *path, const pal_image_map *map, image_list *out, pal_diagnostic *diag)
{
    char file[PATH];
    uint8_t *bytes;
    size_t n_byte;
    pal_err err = PAL_ERR_OK;
    for (int m = 0; m < map->n_material; m++) out->of[m] = -1;
    if (!map->library[0]) return PAL_ERR_OK;
    if (strchr(map->library, '/') || map->library[0] == '.')
        return PAL_REFUSE(diag,
                          "%s: mtllib: %.60s is not the plain name of a file: put it beside the OBJ file, or leave "
                          "the image out (--no-image)",
                          path, map->library);
    if (!beside(path, map->library, file) || access(file, F_OK))
        return memcpy(out->absent, map->library, sizeof out->absent), PAL_ERR_OK;
    PAL_TRY(pal_file_read(file, MATERIAL_MAX_BYTE, &bytes, &n_byte, diag));
    for (int m = 0; m < map->n_material && !err; m++) {
        pal_material_name name;
        err = pal_material_image(file, bytes, n_byte, map->material[m], name, diag);
        if (err || !name[0]) continue;
        if (!beside(path, name, file) || access(file, F_OK)) {
            if (!out->absent[0]) memcpy(out->absent, name, sizeof name);
            continue;
        }
        const int k = find_name(out, name);
        if (k == out->n) memcpy(out->name[out->n++], name, sizeof name);
        out->of[m] = k;
    }
    free(bytes);
    return err;
}

static void report_images(const image_list *list, const pal_image *image, char *out, size_t n_byte)
{
    int n = 0;
    if (list->n == 1)
        n = snprintf(out, n_byte, "image %.60s, %d x %d pixels", list->name[0], image->width, image->height);
    if (list->n > 1)
        n = snprintf(out, n_byte, "%d images, the first %.50s, %d x %d pixels", list->n, list->name[0], image->width,
                     image->height);
    if (list->absent[0])
        snprintf(out + n, n_byte - (size_t)n, "%s%.60s is not there", n ? "; " : "no image: ", list->absent);
}

static pal_err take_images(const char *path, const pal_image_map *map, const image_list *list, pal_loaded_scene *loaded,
                           pal_diagnostic *diag)
{
    char file[PATH];
    pal_diagnostic reason = {""};
    if (list->n > PAL_IMAGES_MAX) {
        pal_err err = pal_images_check(NULL, list->n, &reason);
        return pal_diagnostic_set(diag, err, "%s: %s", path, reason.text);
    }
    for (int k = 0; k < list->n; k++) {
        (void)beside(path, list->name[k], file);
        PAL_TRY(pal_image_read(file, &loaded->image[0][k], diag));
    }
    pal_err err = pal_images_check(loaded->image[0], list->n, &reason);
    if (!err) err = pal_image_map_take(map, list->of, &loaded->mesh[0].surface);
    return err ? pal_diagnostic_set(diag, err, "%s: %s", path, reason.text[0] ? reason.text : "no memory for images")
               : PAL_ERR_OK;
}

pal_err pal_scene_take_images(const char *path, const pal_image_map *map, pal_loaded_scene *loaded,
                              pal_surface_scene_report *report, pal_diagnostic *diag)
{
    image_list *list = calloc(1, sizeof *list);
    pal_err err = list ? list_images(path, map, list, diag) : PAL_ERR_MEMORY;
    if (!err && list->n > 0) err = take_images(path, map, list, loaded, diag);
    if (!err) report_images(list, &loaded->image[0][0], report->image, sizeof report->image);
    free(list);
    return err;
}
