/* The image of an OBJ file: mtllib and usemtl lead to map_Kd, whose file lies beside the OBJ file. */
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/material_file.h"
#include "server/mesh/volume/image_seams.h"
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

/* the name of the image; "": report->image says why there is none */
static pal_err find_image(const char *path, const pal_image_map *map, char image[128], pal_surface_scene_report *report,
                          pal_diagnostic *diag)
{
    char file[PATH];
    uint8_t *bytes;
    size_t n_byte;
    image[0] = 0;
    if (!map->library[0]) return PAL_ERR_OK;
    if (strchr(map->library, '/') || map->library[0] == '.')
        return PAL_REFUSE(diag,
                          "%s: mtllib: %.60s is not the plain name of a file: put it beside the OBJ file, or leave "
                          "the image out (--no-image)",
                          path, map->library);
    if (!beside(path, map->library, file) || access(file, F_OK)) {
        snprintf(report->image, sizeof report->image, "no image: %.100s is not there", map->library);
        return PAL_ERR_OK;
    }
    PAL_TRY(pal_file_read(file, MATERIAL_MAX_BYTE, &bytes, &n_byte, diag));
    pal_err err = pal_material_image(file, bytes, n_byte, map->material, image, diag);
    free(bytes);
    return err;
}

pal_err pal_scene_take_image(const char *path, const pal_image_map *map, pal_loaded_scene *loaded,
                             pal_surface_scene_report *report, pal_diagnostic *diag)
{
    char name[128], file[PATH];
    pal_diagnostic reason = {""};
    PAL_TRY(find_image(path, map, name, report, diag));
    if (!name[0]) return PAL_ERR_OK;
    if (!beside(path, name, file) || access(file, F_OK)) {
        snprintf(report->image, sizeof report->image, "no image: %.100s is not there", name);
        return PAL_ERR_OK;
    }
    PAL_TRY(pal_image_read(file, &loaded->image[0], diag));
    pal_err err = pal_image_seams_make(map, &loaded->mesh[0], &reason);
    if (err == PAL_ERR_REFUSED) {
        pal_image_free(&loaded->image[0]);
        snprintf(report->image, sizeof report->image, "no image: %.140s", reason.text);
        return PAL_ERR_OK;
    }
    if (err) return pal_diagnostic_set(diag, err, "%s: %s", path, reason.text);
    snprintf(report->image, sizeof report->image, "image %.80s, %d x %d pixels", name, loaded->image[0].width,
             loaded->image[0].height);
    return PAL_ERR_OK;
}
