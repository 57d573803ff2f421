/* A series of VTU or VTP files and its PVD (ParaView Guide, "ParaView Data (PVD) File Format"). */
#include "server/commands/vtk_series.h"

#include "server/commands/shown_moment.h"
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/vtk_file.h"
#include "server/scene/scene_file.h"
#include "server/scene/scene_import.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PATH = 1400, FIELDS = 2 + PAL_FIELD_COUNT };

static const struct {
    pal_field field;
    const char *name;
} measured[] = {{PAL_FIELD_VON_MISES_PA, "von_mises_Pa"},  {PAL_FIELD_ENERGY_J_M3, "energy_J_m3"},
                {PAL_FIELD_STIFFNESS_J, "stiffness_J"},    {PAL_FIELD_STRAIN, "strain"},
                {PAL_FIELD_DISTORTION, "distortion"},      {PAL_FIELD_YOUNG_PA, "young_Pa"},
                {PAL_FIELD_DENSITY_KG_M3, "density_kg_m3"}};

/* false: no component of the body gives the field */
static bool measure(const pal_world *world, const pal_body *b, pal_field field, double *value, double *volume)
{
    bool given = false;
    memset(value, 0, (size_t)b->n_node * sizeof *value);
    memset(volume, 0, (size_t)b->n_node * sizeof *volume);
    for (int k = 0; k < pal_world_component_count(world); k++) {
        const pal_component *c = pal_world_component(world, k);
        pal_component_info info;
        pal_world_component_info(world, k, &info);
        if (!info.body || strcmp(info.body, b->name) != 0) continue;
        if (!c->effect->inspect.measure || !(c->effect->inspect.fields & 1u << field)) continue;
        c->effect->inspect.measure(c->self, b, field, value, volume);
        given = true;
    }
    for (int i = 0; i < b->n_node; i++) value[i] = volume[i] > 0 ? value[i] / volume[i] : 0;
    return given;
}

/* the fields of a body; value: room for all of them [FIELDS + 2][n_node] */
static int take_fields(const pal_world *world, const pal_body *b, double *value, pal_vtk_field *out)
{
    const size_t n = (size_t)b->n_node;
    double *moved = value, *at = value + 3 * n, *volume = value + (FIELDS + 1) * n;
    int n_field = 0;
    for (size_t k = 0; k < 3 * n; k++) moved[k] = b->d[k] - b->node_rest[k];
    out[n_field++] = (pal_vtk_field){"displacement_m", 3, moved};
    out[n_field++] = (pal_vtk_field){"velocity_m_s", 3, b->dv};
    for (size_t k = 0; k < sizeof measured / sizeof *measured; k++)
        if (measure(world, b, measured[k].field, at, volume)) {
            out[n_field++] = (pal_vtk_field){measured[k].name, 1, at};
            at += n;
        }
    return n_field;
}

static pal_err path_of(const pal_vtk_series *s, const char *file, char path[PATH], pal_diagnostic *diag)
{
    return snprintf(path, PATH, "%s/%s", s->folder, file) < PATH
               ? PAL_ERR_OK
               : PAL_REFUSE(diag, "%.80s...: the path is too long", s->folder);
}

static pal_err write_body(const pal_vtk_series *s, const char *file, const pal_world *world, const pal_body *b,
                          pal_diagnostic *diag)
{
    char path[PATH];
    pal_vtk_field field[FIELDS];
    PAL_TRY(path_of(s, file, path, diag));
    double *value = malloc((FIELDS + 2) * (size_t)b->n_node * sizeof *value);
    if (!value) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for %d nodes", file, b->n_node);
    const bool own = b->element != NULL;
    const pal_vtk_grid grid = {.n_node = b->n_node,
                               .n_element = own ? b->n_element : b->tets->n_tet,
                               .n_corner = own ? b->n_corner : 4,
                               .x = b->d,
                               .origin_m = b->offset_m,
                               .node = own ? b->element : b->tets->tet,
                               .n_point = take_fields(world, b, value, field),
                               .point = field};
    const pal_err err = pal_mesh_write_vtu(path, &grid, diag);
    free(value);
    return err;
}

static pal_err write_elements(pal_vtk_series *s, const pal_world *world, double now_s, pal_diagnostic *diag)
{
    char name[PAL_NAME], file[PAL_NAME + 40];
    for (int k = 0; k < pal_world_body_count(world); k++) {
        const pal_body *b = pal_world_view_body(world, k);
        if (!b->element && (!b->tets || b->tets->n_tet == 0)) continue;
        /* the name of a body is any text, that of a file has no path and no sign of XML; two bodies may share it */
        pal_scene_plain_name(b->name, "body", name);
        snprintf(file, sizeof file, "%s_%d_%06d.vtu", name, k + 1, s->n_moment);
        PAL_TRY(write_body(s, file, world, b, diag));
        fprintf(s->to, "<DataSet timestep=\"%.9g\" part=\"%d\" name=\"%s\" file=\"%s\"/>\n", now_s, k, name, file);
        s->n_file++;
    }
    return PAL_ERR_OK;
}

static pal_err write_surfaces(pal_vtk_series *s, const pal_world *world, double now_s, pal_diagnostic *diag)
{
    char path[PATH], file[40];
    snprintf(file, sizeof file, "surfaces_%06d.vtp", s->n_moment);
    PAL_TRY(path_of(s, file, path, diag));
    pal_shown_moment moment = {.vtp = path, .at_s = now_s};
    PAL_TRY(pal_shown_moment_step(&moment, s->scene, world, now_s, diag));
    fprintf(s->to, "<DataSet timestep=\"%.9g\" file=\"%s\"/>\n", now_s, file);
    s->n_file++;
    return PAL_ERR_OK;
}

pal_err pal_vtk_series_step(pal_vtk_series *s, const pal_world *world, double now_s, pal_diagnostic *diag)
{
    /* a rounding of the sum of steps does not delay a moment by a step */
    if (now_s < s->next_s - 1e-9) return PAL_ERR_OK;
    if (s->n_moment == 0) PAL_TRY(pal_scene_make_folder(s->folder, diag));
    if (!s->to && !(s->to = open_memstream(&s->list, &s->n_byte)))
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for its list", s->folder);
    while (s->next_s <= now_s + 1e-9) s->next_s += s->period_s;
    PAL_TRY((s->scene ? write_surfaces : write_elements)(s, world, now_s, diag));
    s->n_moment++;
    return PAL_ERR_OK;
}

pal_err pal_vtk_series_end(pal_vtk_series *s, pal_diagnostic *diag)
{
    char path[PATH];
    pal_file_out out;
    if (s->n_file == 0)
        return PAL_REFUSE(diag, "%s",
                          s->scene ? "--vtp: the recording has no step"
                                   : "--vtu: no body of the scene has elements of volume");
    if (fflush(s->to)) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for its list", s->folder);
    PAL_TRY(path_of(s, s->scene ? "surfaces.pvd" : "series.pvd", path, diag));
    PAL_TRY(pal_file_begin(&out, path, diag));
    fprintf(out.file,
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" "
            "byte_order=\"LittleEndian\">\n<Collection>\n%s</Collection>\n</VTKFile>\n",
            s->list);
    return pal_file_end(&out, diag);
}

void pal_vtk_series_free(pal_vtk_series *s)
{
    if (s->to) fclose(s->to);
    free(s->list);
    s->to = NULL, s->list = NULL;
}
