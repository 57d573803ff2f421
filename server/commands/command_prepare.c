/* `palpate prepare`: surface file, label volume or procedural shape -> DIR/scene.json, the prepared mesh and TetGen
 * files. All files are written into a hidden folder inside DIR and then moved, scene.json last, so that DIR never holds
 * a part of a scene. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/cli/report.h"
#include "server/cli/table.h"
#include "server/commands/commands.h"
#include "server/commands/tuning.h"
#include "server/mesh/files/mesh_file.h"
#include "server/mesh/scan/dicom_series.h"
#include "server/scene/scene_arg.h"
#include "server/scene/scene_file.h"
#include "server/sim/world/world.h"
#include "server/solve/preflight.h"

#include <dirent.h>
#include <errno.h>
#include <ftw.h>
#include <math.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { PATH = 1200, TETGEN_MAX = 1000000, LABELS = 256, FILES = 64, SENTENCE = 160, RESOLUTION_MAX = 1024 };

static const char about[] =
    "Makes a scene from a surface (OBJ, STL, PLY, OFF) or a segmented scan (NIfTI .nii .nii.gz, NRRD .nrrd,\n"
    "MetaImage .mha, INRIMAGE .inr .inr.gz), as 3D Slicer exports them, or from a folder with a DICOM series, which\n"
    "the program dcm2niix converts: tetrahedra (paper B section 2.2), skin, tissue, supports and tools.\n"
    "`palpate serve DIR/scene.json` serves it. With --model adaptive the surface of a hollow organ carries springs and "
    "refines where it is\n"
    "touched (paper C).\n"
    "\n"
    "Voxels connect through faces. A component without a support is dropped, with a message, when it is below 1 %\n"
    "of the largest one. A larger one is refused: --largest keeps the largest component only, --hold may reach\n"
    "the others, a finer --resolution may connect them. In scene.json each component may have its own support, or\n"
    "the body none: then it is free.\n"
    "\n"
    "Writes DIR/scene.json, DIR/NAME.palmesh, and DIR/NAME.node .ele .face for TetGen when the mesh has at most\n"
    "1,000,000 tetrahedra (--tetgen: always, --no-tetgen: never). Either all files are written or none.\n";

typedef struct arguments {
    pal_surface_scene scene;
    const char *folder, *units, *up, *axes, *name, *title, *source, *model, *threshold;
    double hold_percent, thickness_mm;
    bool procedural, list_labels, tetgen, no_tetgen;
} arguments;

typedef struct outcome {
    pal_surface_scene_report report;
    double write_s, total_s;
    /* model adaptive_springs only */
    size_t world_byte;
    double limit_s;
    int n_substep,
        fine_substep;          /* of a step at rest; with a face of the finest level, as each level halves the bound */
    int max_node;              /* limit of the component refine; 0: none is needed                                  */
    double busy;               /* predicted share of real time with as many nodes as the limit allows               */
    char size[SENTENCE];       /* a question about the unit; "": the size is an organ's */
    char volume[2 * SENTENCE]; /* what the voxels do to a thin organ, and the remedy; "": they fit it */
    char slow[PAL_PREFLIGHT_LINE]; /* the body returns slowly; "": it does not, or its world takes long */
    char file[FILES][80];
    int n_file;
} outcome;

static int list_labels(const pal_flag_common *common, const char *path)
{
    pal_label_volume volume;
    static pal_label_count count[LABELS];
    pal_diagnostic diag = {""};
    pal_err err = pal_scan_read(path, &volume, &diag);
    if (err) return pal_report_refusal(common, err, &diag);
    int n = pal_label_volume_list(&volume, count, LABELS);
    pal_label_volume_free(&volume);
    pal_table t = {.silent = common->json || common->quiet, .root = PAL_JSON({"ok", JSON_BOOL(true)})};
    pal_table_list(&t, "labels");
    for (int k = 0; k < n; k++)
        TABLE_ROW(&t, NUMBER("label", "label", 10, 0, count[k].label),
                  NUMBER("voxels", "voxels", 12, 0, (double)count[k].n_voxel),
                  NUMBER(NULL, "millilitres", 12, 1, 1e6 * count[k].volume_m3), VALUE("volume_m3", count[k].volume_m3));
    return pal_report_end(common, PAL_ERR_OK, &diag, t.root);
}

/* ---- writing ---- */

static int by_name(const void *a, const void *b)
{
    return strcmp(a, b);
}

/* moves every file of the staging folder up into its parent, scene.json last */
static pal_err move_up(const char *stage, const char *folder, outcome *out, pal_diagnostic *diag)
{
    char from[PATH + 300], to[PATH + 300];
    DIR *list = opendir(stage);
    if (!list) return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", stage, strerror(errno));
    out->n_file = 0;
    for (struct dirent *entry; (entry = readdir(list)) && out->n_file < FILES - 1;)
        if (entry->d_name[0] != '.' && strcmp(entry->d_name, "scene.json"))
            snprintf(out->file[out->n_file++], sizeof out->file[0], "%.79s", entry->d_name);
    closedir(list);
    qsort(out->file, (size_t)out->n_file, sizeof out->file[0], by_name);
    snprintf(out->file[out->n_file++], sizeof out->file[0], "scene.json");
    for (int k = 0; k < out->n_file; k++) {
        snprintf(from, sizeof from, "%s/%s", stage, out->file[k]);
        snprintf(to, sizeof to, "%s/%s", folder, out->file[k]);
        if (rename(from, to))
            return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: cannot be written: %s", to, strerror(errno));
    }
    return PAL_ERR_OK;
}

static int remove_one(const char *path, const struct stat *facts, int kind, struct FTW *place)
{
    (void)facts, (void)kind, (void)place;
    return remove(path);
}

/* is what was written a scene that serve takes? */
static pal_err read_back(const char *stage, pal_diagnostic *diag)
{
    char path[PATH + 20];
    pal_loaded_scene *again = NULL;
    snprintf(path, sizeof path, "%s/scene.json", stage);
    pal_err err = pal_scene_arg(path, NULL, &again, NULL, NULL, diag);
    pal_scene_free(again);
    /* its path is gone when somebody reads the sentence */
    const size_t n = strlen(path);
    if (err && !strncmp(diag->text, path, n) && !strncmp(diag->text + n, ": ", 2))
        memmove(diag->text, diag->text + n + 2, strlen(diag->text + n + 2) + 1);
    return err;
}

static pal_err save(const pal_loaded_scene *loaded, const arguments *args, outcome *out, pal_diagnostic *diag)
{
    char stage[PATH], stem[PATH + 100];
    bool was_there = access(args->folder, F_OK) == 0;
    int n_tet = loaded->mesh[0].tets.n_tet;
    bool tetgen = args->tetgen || (!args->no_tetgen && n_tet > 0 && n_tet <= TETGEN_MAX);
    int n = snprintf(stage, sizeof stage, "%s/.palpate-%ld", args->folder, (long)getpid());
    if (n < 0 || (size_t)n >= sizeof stage) return PAL_REFUSE(diag, "%.80s...: the path is too long", args->folder);
    snprintf(stem, sizeof stem, "%s/%s", stage, loaded->scene.body[0].name);
    /* a signal waits until all files are written or removed */
    sigset_t asked, old;
    sigemptyset(&asked);
    sigaddset(&asked, SIGINT);
    sigaddset(&asked, SIGTERM);
    sigaddset(&asked, SIGHUP);
    sigprocmask(SIG_BLOCK, &asked, &old);
    pal_err err = pal_scene_make_folder(args->folder, diag);
    if (!err) err = pal_scene_save(loaded, stage, diag);
    if (!err) err = read_back(stage, diag);
    if (!err && tetgen) err = pal_mesh_file_write_tetgen(stem, &loaded->mesh[0].tets, diag);
    if (!err) err = move_up(stage, args->folder, out, diag);
    nftw(stage, remove_one, 4, FTW_DEPTH | FTW_PHYS);
    if (err && !was_there) rmdir(args->folder);
    sigprocmask(SIG_SETMASK, &old, NULL);
    return err;
}

/* ---- report ---- */

/* figures of voxels and tetrahedra */
static void add_solid(cJSON *o, const pal_prepared *mesh, const pal_surface_scene_report *r)
{
    const pal_voxel_report *v = &r->prepare.voxel;
    PAL_JSON_ADD(
        o, {"resolution", JSON_NUMBER(r->resolution)}, {"voxels", JSON_NUMBER(r->prepare.n_voxel)},
        {"tets", JSON_NUMBER(mesh->tets.n_tet)}, {"nodes", JSON_NUMBER(mesh->tets.n_node)},
        {"components", JSON_NUMBER(v->n_component)}, {"method", JSON_TEXT(v->method)}, {"open", JSON_BOOL(v->open)},
        {"disagreeing_voxels", JSON_NUMBER(v->n_disagree)}, {"volume_m3", JSON_NUMBER(r->prepare.volume_m3)},
        {"surface_volume_m3", JSON_NUMBER(v->surface_volume_m3)},
        {"inside_volume_m3", JSON_NUMBER(v->inside_volume_m3)}, {"volume_error", JSON_NUMBER(r->prepare.volume_error)});
}

/* figures of the levels of an adaptive surface */
static void add_levels(cJSON *o, const outcome *out)
{
    const pal_surface_scene_report *r = &out->report;
    bool closed = r->n_open_edge == 0;
    cJSON *levels = cJSON_CreateArray();
    for (int l = 0; l < r->n_level; l++)
        cJSON_AddItemToArray(levels,
                             PAL_JSON({"nodes", JSON_NUMBER(r->n_node[l])}, {"springs", JSON_NUMBER(r->n_spring[l])}));
    PAL_JSON_ADD(o, {"levels", levels}, {"components", JSON_NUMBER(r->n_piece)}, {"closed", JSON_BOOL(closed)},
                 {"open_edges", JSON_NUMBER(r->n_open_edge)}, {"area_m2", JSON_NUMBER(r->area_m2)},
                 {"surface_volume_m3", closed ? JSON_NUMBER(r->volume_m3) : NULL}, {"mass_kg", JSON_NUMBER(r->mass_kg)},
                 {"level_bytes", JSON_NUMBER(r->level_byte)}, {"world_bytes", JSON_NUMBER(out->world_byte)},
                 {"substeps", JSON_NUMBER(out->n_substep)}, {"limit_s", JSON_NUMBER(out->limit_s)},
                 {"finest_substeps", JSON_NUMBER(out->fine_substep)},
                 {"most_node", out->max_node > 0 ? JSON_NUMBER(out->max_node) : NULL},
                 {"share_of_real_time", JSON_NUMBER(out->busy)});
}

static cJSON *as_json(const pal_loaded_scene *loaded, const arguments *args, const outcome *out)
{
    const pal_surface_scene_report *r = &out->report;
    const pal_surface_report *read = &r->surface;
    const pal_prepared *mesh = &loaded->mesh[0];
    const pal_loose_components *loose = &loaded->loose[0];
    char path[PATH + 16];
    snprintf(path, sizeof path, "%s/scene.json", args->folder);
    cJSON *o = PAL_JSON(
        {"ok", JSON_BOOL(true)}, {"scene", JSON_TEXT(path)}, {"name", JSON_TEXT(loaded->scene.name)},
        {"title", JSON_TEXT(loaded->scene.title)},
        {"files", pal_json_texts(out->file[0], sizeof out->file[0], out->n_file)}, {"format", JSON_TEXT(read->format)},
        {"units", PAL_JSON({"name", JSON_TEXT(args->units ? args->units : r->unit_name)}, {"m", JSON_NUMBER(r->unit_m)},
                           {"guessed", JSON_BOOL(r->unit_guessed)})},
        {"label", r->label >= 0 ? JSON_NUMBER(r->label) : NULL}, {"triangles", JSON_NUMBER(mesh->surface.n_tri)},
        {"vertices", JSON_NUMBER(mesh->surface.n_vertex)}, {"anatomical_axes", r->axes[0] ? JSON_TEXT(r->axes) : NULL},
        {"image", r->image[0] ? JSON_TEXT(r->image) : NULL},
        {"size_question", out->size[0] ? JSON_TEXT(out->size) : NULL},
        {"volume_remark", out->volume[0] ? JSON_TEXT(out->volume) : NULL});
    if (r->n_level > 0)
        add_levels(o, out);
    else
        add_solid(o, mesh, r);
    cJSON *dropped =
        PAL_JSON({"degenerate", JSON_NUMBER(read->n_degenerate)}, {"duplicate", JSON_NUMBER(read->n_duplicate)},
                 {"nonfinite", JSON_NUMBER(read->n_nonfinite)}, {"folded", JSON_NUMBER(read->n_folded)},
                 {"loose_components", JSON_NUMBER(loose->n_dropped)}, {"loose_m3", JSON_NUMBER(loose->dropped_m3)});
    cJSON *seconds = PAL_JSON({"read", JSON_NUMBER(r->read_s)}, {"tree", JSON_NUMBER(r->prepare.voxel.tree_s)},
                              {"fill", JSON_NUMBER(r->prepare.voxel.fill_s)},
                              {"split", JSON_NUMBER(r->prepare.split_s)}, {"skin", JSON_NUMBER(r->prepare.skin_s)},
                              {"write", JSON_NUMBER(out->write_s)}, {"total", JSON_NUMBER(out->total_s)});
    return PAL_JSON_ADD(o, {"dropped", dropped}, {"mended", JSON_NUMBER(read->n_repaired)},
                        {"welded", JSON_NUMBER(read->n_welded)}, {"welded_apart_m", JSON_NUMBER(read->max_weld_m)},
                        {"slow", out->slow[0] ? JSON_TEXT(out->slow) : NULL}, {"seconds", seconds});
}

/* in the unit that gives one to four digits before the decimal point; returns out */
static const char *volume_text(double volume_m3, char out[32])
{
    static const struct {
        double m3;
        const char *unit;
    } unit[] = {{1, "m3"}, {1e-3, "l"}, {1e-6, "ml"}, {1e-9, "mm3"}};
    size_t k = 0;
    while (k < 3 && volume_m3 < 5 * unit[k].m3) k++;
    snprintf(out, 32, "%.1f %s", volume_m3 / unit[k].m3, unit[k].unit);
    return out;
}

static void print_solid(const pal_prepared *mesh, const pal_surface_scene_report *r)
{
    int n_component = r->prepare.voxel.n_component;
    char known[32], whole[32];
    printf("%d tetrahedra, %d nodes from %lld voxels at resolution %d, %d component%s, inside by %s\n",
           mesh->tets.n_tet, mesh->tets.n_node, (long long)r->prepare.n_voxel, r->resolution, n_component,
           n_component == 1 ? "" : "s", r->prepare.voxel.method);
    printf("volume %s by the surface%s, %+.1f %% by the voxels inside, %s with the border layer\n",
           volume_text(r->prepare.voxel.surface_volume_m3, known),
           r->prepare.voxel.open ? " (open: its holes count as closed)" : "", 100 * r->prepare.volume_error,
           volume_text(r->prepare.volume_m3, whole));
}

static void print_levels(const pal_prepared *mesh, const arguments *args, const outcome *out)
{
    const pal_surface_scene_report *r = &out->report;
    char volume[32];
    for (int l = 0; l < r->n_level; l++) printf("level %d: %d nodes, %d springs\n", l, r->n_node[l], r->n_spring[l]);
    printf("%d component%s, ", r->n_piece, r->n_piece == 1 ? "" : "s");
    if (r->n_open_edge > 0)
        printf("open along %d edges", r->n_open_edge);
    else
        printf("closed around %s", volume_text(r->volume_m3, volume));
    printf(", wall of %.1f cm2 and %.1f g\n", 1e4 * r->area_m2, 1e3 * r->mass_kg);
    printf("memory %.1f MB, of it %.1f for the levels; %d sub-step%s a step at rest\n", 1e-6 * (double)out->world_byte,
           1e-6 * (double)r->level_byte, out->n_substep, out->n_substep == 1 ? "" : "s");
    if (!args->scene.target_tri && r->surface.n_tri_read > 2 * mesh->surface.n_tri)
        printf("decimated from %lld triangles, so that it runs in real time (--triangles overrides)\n",
               (long long)r->surface.n_tri_read);
    if (out->max_node > 0)
        printf(
            "refined to at most %d nodes at a time (most_node of refine); the finest level needs %d sub-steps a step\n",
            out->max_node, out->fine_substep);
    if (out->busy > 1)
        printf("about %.1f times too slow for real time: --triangles makes the surface coarser; fewer --levels or a "
               "smaller --young-Pa need fewer sub-steps\n",
               out->busy);
}

static void print(const pal_loaded_scene *loaded, const arguments *args, const outcome *out)
{
    const pal_surface_scene_report *r = &out->report;
    const pal_surface_report *d = &r->surface;
    const pal_prepared *mesh = &loaded->mesh[0];
    int n_component = r->n_level > 0 ? r->n_piece : r->prepare.voxel.n_component;
    double low[3], high[3];
    pal_diagnostic dropped;
    pal_surface_box(&mesh->surface, low, high);
    printf("%s (%s): %d triangles, %.0f x %.0f x %.0f mm", loaded->scene.title, r->surface.format, mesh->surface.n_tri,
           1e3 * (high[0] - low[0]), 1e3 * (high[1] - low[1]), 1e3 * (high[2] - low[2]));
    if (r->unit_guessed && !strcmp(r->unit_name, "scaled"))
        printf(", no unit fits the size in the file: scaled to an organ (--units overrides)");
    else if (r->unit_guessed)
        printf(", unit %s guessed from the size (--units overrides)", r->unit_name);
    if (r->axes[0]) printf(", axes %s", r->axes);
    if (r->n_label > 1 && args->scene.label < 0)
        printf(", the most frequent of %d labels (--list-labels lists them)", r->n_label);
    printf("\n");
    if (r->n_level > 0)
        print_levels(mesh, args, out);
    else
        print_solid(mesh, r);
    if (n_component > 1) printf("the components are not connected, each has its own support (--largest keeps one)\n");
    pal_loose_components_describe(&loaded->loose[0], loaded->scene.body[0].name, &dropped);
    if (dropped.text[0]) printf("%s\n", dropped.text);
    if (r->image[0]) printf("%s\n", r->image);
    if (out->slow[0]) printf("%s\n", out->slow);
    if (out->size[0]) printf("%s\n", out->size);
    if (out->volume[0]) printf("%s\n", out->volume);
    if (d->max_weld_m > 0)
        printf("welded %lld corners that were up to %.2g mm apart\n", (long long)d->n_welded, 1e3 * d->max_weld_m);
    if (d->n_degenerate + d->n_duplicate + d->n_nonfinite + d->n_folded > 0)
        printf("dropped triangles: %lld degenerate, %lld duplicate, %lld not finite, %lld folded\n",
               (long long)d->n_degenerate, (long long)d->n_duplicate, (long long)d->n_nonfinite,
               (long long)d->n_folded);
    printf("wrote");
    for (int k = 0; k < out->n_file; k++) printf(" %s", out->file[k]);
    printf(" to %s in %.2f s; now: palpate serve %s/scene.json\n", args->folder, out->total_s, args->folder);
}

/* Makes the world of an adaptive surface once, so that a scene that cannot be served is refused now. Where the finest
 * level of the whole surface would take more than its share of a step, refinement is limited. */
static pal_err limit_nodes(pal_loaded_scene *loaded, const char *name, outcome *out, pal_diagnostic *diag)
{
    pal_scene *scene = &loaded->scene;
    pal_world *world;
    PAL_TRY(pal_diagnostic_prefix(diag, pal_world_create(scene, diag, &world), name));
    out->world_byte = pal_world_bytes(world);
    out->n_substep = pal_world_substeps(world);
    out->limit_s = pal_world_limit_s(world);
    pal_world_destroy(world);
    const pal_surface_scene_report *r = &out->report;
    int finest = r->n_level - 1, n = r->n_node[finest];
    double limit = n, pace = scene->step_s / PAL_NODE_S;
    out->fine_substep = (int)fmax(1, ceil(ldexp(scene->step_s / out->limit_s, finest)));
    if (finest > 0)
        limit = fmax(PAL_MAX_BUSY * pace / out->fine_substep, (1 + PAL_MIN_EXTRA_SHARE) * r->n_node[0] + PAL_MIN_EXTRA);
    out->busy = fmin(limit, n) * out->fine_substep / pace;
    if (limit >= n) return PAL_ERR_OK;
    out->max_node = (int)limit;
    pal_body_def *body = &scene->body[0];
    pal_config_entry *refine = &body->effect[body->n_effect];
    pal_entry_init(refine, "", "refine");
    snprintf(refine->path, sizeof refine->path, "bodies[0].effects[%d]", body->n_effect++);
    return pal_entry_put_number(refine, "most_node", out->max_node, diag);
}

/* what a user should know before serving: that the body returns slowly. Left out for a body whose world takes long */
static pal_err find_return(const pal_loaded_scene *loaded, outcome *out, pal_diagnostic *diag)
{
    pal_world *world;
    if (loaded->scene.body[0].mesh->tets.n_node > PAL_RETURN_NODES) return PAL_ERR_OK;
    PAL_TRY(pal_world_create(&loaded->scene, diag, &world));
    pal_err err = PAL_ERR_OK;
    if (!(pal_world_body(world, 0)->lowest_1_s > 0)) err = pal_world_find_lowest(world, 0, NULL);
    (void)pal_preflight_slow(pal_world_body(world, 0), out->slow);
    pal_world_destroy(world);
    return err;
}

/* no organ is so small or so large: a unit of the file is wrong. Names the one that gives the usual size */
static void question_size(const pal_loaded_scene *loaded, double unit_m, char text[SENTENCE])
{
    static const char *const unit[] = {"mm", "cm", "in", "um", "m"};
    double low[3], high[3], size_m = 0;
    const char *likely = NULL;
    text[0] = 0;
    pal_surface_box(&loaded->mesh[0].surface, low, high);
    for (int k = 0; k < 3; k++) size_m = fmax(size_m, high[k] - low[k]);
    if (size_m >= PAL_ORGAN_MIN_M && size_m <= PAL_ORGAN_MAX_M) return;
    for (size_t k = 0; k < sizeof unit / sizeof *unit && !likely; k++) {
        const double other_m = unit_m > 0 ? size_m / unit_m * pal_mesh_unit_named(unit[k]) : 0;
        if (other_m >= PAL_ORGAN_MIN_M && other_m <= PAL_ORGAN_MAX_M) likely = unit[k];
    }
    if (likely)
        snprintf(text, SENTENCE, "the body is %.3g m long: is the file in %s? (--units %s)", size_m, likely, likely);
    else
        snprintf(text, SENTENCE, "the body is %.3g m long: is its unit right? (--units)", size_m);
}

/* A thin organ is missed by its voxels, or by their layer around it that model springs counts in full, while model fem
 * weighs each voxel by its filled share. What shells that are open or lie in each other enclose is uncertain at any
 * resolution. */
static void judge_volume(const pal_surface_scene_report *r, const pal_surface_scene *options, char text[2 * SENTENCE])
{
    const double missed = 100 * fabs(r->prepare.volume_error), surface_m3 = r->prepare.voxel.surface_volume_m3;
    const double whole = surface_m3 > 0 ? r->prepare.volume_m3 / surface_m3 : 0;
    const int finer = (int)fmin(2 * r->resolution, RESOLUTION_MAX);
    text[0] = 0;
    if (r->n_level > 0) return;
    if (missed > 100 * PAL_VOLUME_MISSED && r->prepare.voxel.open)
        snprintf(
            text, 2 * SENTENCE,
            "the voxels miss the volume of the surface by %.0f %%, which is uncertain as the surface is open: close "
            "its holes and join its shells, or --model adaptive keeps the surface itself",
            missed);
    else if (missed > 100 * PAL_VOLUME_MISSED)
        snprintf(text, 2 * SENTENCE,
                 "the voxels miss the volume of the surface by %.0f %%%s: --resolution %d comes nearer, and --model "
                 "adaptive keeps the surface itself",
                 missed, options->largest_only ? " with what --largest leaves out" : "", finer);
    else if (!options->fem && whole > PAL_LAYER_OUTWEIGHS)
        snprintf(
            text, 2 * SENTENCE,
            "with their border layer the voxels have %.1f times the volume of the surface, as parts of it are thin: "
            "--model fem counts what lies inside, --resolution %d comes nearer, --model adaptive keeps the surface",
            whole, finer);
}

static int run(pal_flag_common *common, const char *in, arguments *args)
{
    pal_loaded_scene *loaded = NULL;
    static outcome out;
    pal_diagnostic diag = {""};
    double start = pal_clock_s();
    args->scene.progress = pal_report_progress;
    args->scene.user = common;
    pal_err err = !in ? pal_scene_procedural(&args->scene, &loaded, &out.report, &diag)
                      : pal_scene_from_surface(in, &args->scene, &loaded, &out.report, &diag);
    if (err) return pal_report_refusal(common, err, &diag);
    question_size(loaded, out.report.unit_m, out.size);
    judge_volume(&out.report, &args->scene, out.volume);
    err = pal_scene_rename(loaded, args->name, args->title, args->source, &diag);
    if (!err && args->scene.adaptive) err = limit_nodes(loaded, in ? in : "procedural", &out, &diag);
    if (!err) err = pal_diagnostic_prefix(&diag, find_return(loaded, &out, &diag), in ? in : "procedural");
    double before = pal_clock_s();
    pal_report_progress("write", 0, common);
    if (!err) err = pal_diagnostic_prefix(&diag, save(loaded, args, &out, &diag), in ? in : "procedural");
    if (err && out.size[0])
        snprintf(diag.text + strlen(diag.text), sizeof diag.text - strlen(diag.text), "; %s", out.size);
    out.write_s = pal_clock_s() - before;
    out.total_s = pal_clock_s() - start;
    int code = pal_report_end(common, err, &diag, err || !common->json ? NULL : as_json(loaded, args, &out));
    if (!err && !common->json && !common->quiet) print(loaded, args, &out);
    pal_scene_free(loaded);
    return code;
}

/* NULL: the flags fit the model, else the sentence */
static const char *check_model(arguments *args)
{
    pal_surface_scene *s = &args->scene;
    s->fem = args->model && !strcmp(args->model, "fem");
    s->adaptive = args->model ? !strcmp(args->model, "adaptive") : s->shape && strcmp(s->shape, "organ") != 0;
    const struct {
        bool wrong;
        const char *sentence;
    } check[] = {{s->fem && s->area_springs, "--area-springs: model fem has no springs"},
                 {!s->fem && s->element, "--element: only goes with --model fem"},
                 {!s->fem && s->law, "--law: only goes with --model fem"},
                 {!s->fem && s->solver, "--solver: only goes with --model fem"},
                 {!s->adaptive && s->n_level, "--levels: only goes with --model adaptive"},
                 {!s->adaptive && args->thickness_mm > 0, "--thickness-mm: only goes with --model adaptive"},
                 {!s->adaptive && s->inflate_Pa != 0, "--inflate: only goes with --model adaptive"},
                 {s->adaptive && s->resolution, "--resolution: model adaptive has no voxels"},
                 {s->adaptive && s->area_springs, "--area-springs: model adaptive has springs along edges only"},
                 {s->adaptive && args->tetgen, "--tetgen: model adaptive has no tetrahedra"}};
    for (size_t k = 0; k < sizeof check / sizeof check[0]; k++)
        if (check[k].wrong) return check[k].sentence;
    return NULL;
}

/* "-y" -> (0, -1, 0) */
static bool read_axis(const char *word, double axis[3])
{
    double sign = word[0] == '-' ? -1 : 1;
    word += word[0] == '-';
    if (strlen(word) != 1 || word[0] < 'x' || word[0] > 'z') return false;
    pal_set3(axis, 0, 0, 0);
    axis[word[0] - 'x'] = sign;
    return true;
}

static bool read_threshold(const char *text, pal_surface_scene *scene)
{
    int end = 0;
    scene->threshold = true;
    return sscanf(text, "%d,%d%n", &scene->low, &scene->high, &end) == 2 && !text[end] && scene->low <= scene->high;
}

static arguments args = {.scene = {.label = -1, .material = {0, 0.45, 1000, PAL_DAMPING_DERIVED, 1}}};
static const pal_flag flag[] = {
    {"-o", "DIR", PAL_FLAG_TEXT, &args.folder, 0, 0, "folder to write; made when it does not exist"},
    {"--procedural", NULL, PAL_FLAG_SWITCH, &args.procedural, 0, 0, "without IN: a computed organ"},
    {"--shape", "organ|stomach|sphere|sheet", PAL_FLAG_WORD, &args.scene.shape, 0, 0,
     "without IN: a computed shape; all but organ are adaptive"},
    {"--model", "springs|fem|adaptive", PAL_FLAG_WORD, &args.model, 0, 0,
     "mass-spring tetrahedra (paper B); finite elements, implicit; or a surface of springs that\n"
     "refines where it is touched (paper C) (springs)"},
    {"--resolution", "N", PAL_FLAG_COUNT, &args.scene.resolution, 1, RESOLUTION_MAX,
     "voxels along the longest axis (the number that gives 13,000 tetrahedra, or 2,500 nodes for fem)"},
    {"--element", "hex8_bbar|hex8|tet4|tet10", PAL_FLAG_WORD, &args.scene.element, 0, 0, "fem: element (hex8_bbar)"},
    {"--law", "corotational|neo_hookean|linear", PAL_FLAG_WORD, &args.scene.law, 0, 0,
     "fem: material law (corotational)"},
    {"--solver", "implicit_euler|sdirk2|static_newton", PAL_FLAG_WORD, &args.scene.solver, 0, 0,
     "fem: time integration (implicit_euler)"},
    {"--levels", "N", PAL_FLAG_COUNT, &args.scene.n_level, 1, PAL_LEVELS_MAX,
     "adaptive: levels of detail; the surface is the coarsest, each level has four times the springs\n"
     "of the one before (2)"},
    {"--thickness-mm", "T", PAL_FLAG_NUMBER, &args.thickness_mm, 1e-3, 1000, "adaptive: thickness of the wall (3)"},
    {"--inflate", "PA", PAL_FLAG_NUMBER, &args.scene.inflate_Pa, -1e6, 1e6,
     "adaptive: pressure inside above that outside; closed surfaces only (0)"},
    {"--area-springs", NULL, PAL_FLAG_SWITCH, &args.scene.area_springs, 0, 0,
     "springs: preserve face areas too (edges and volumes alone have the same moduli at half the cost)"},
    {"--label", "N", PAL_FLAG_COUNT, &args.scene.label, 1, INT32_MAX, "label of a segmented scan (the most frequent)"},
    {"--threshold", "LOW,HIGH", PAL_FLAG_TEXT, &args.threshold, 0, 0,
     "the voxels of a volume with values in this range, as 200,3000 Hounsfield units for bone, in place of a label"},
    {"--list-labels", NULL, PAL_FLAG_SWITCH, &args.list_labels, 0, 0, "only list the labels of a segmented scan"},
    {"--no-image", NULL, PAL_FLAG_SWITCH, &args.scene.no_image, 0, 0,
     "leave the images of an OBJ file out (map_Kd of its materials: PNGs or JPEGs beside the file)"},
    {"--units", "UNIT", PAL_FLAG_TEXT, &args.units, 0, 0,
     "unit of a surface file: m, cm, mm, um or in (guessed from the size)"},
    {"--triangles", "N", PAL_FLAG_COUNT, &args.scene.target_tri, 100, 10000000,
     "triangles of the surface of a scan or of the computed organ (50,000); adaptive: of the coarsest\nlevel of a scan "
     "(1,500) or of a file (as many as it has, 1,500 when it has more than 3,000)"},
    {"--largest", NULL, PAL_FLAG_SWITCH, &args.scene.largest_only, 0, 0, "keep the largest of several components only"},
    {"--young-Pa", "E", PAL_FLAG_NUMBER, &args.scene.material.young_Pa, PAL_YOUNG_MIN_PA, PAL_YOUNG_MAX_PA,
     "Young's modulus (5000; adaptive: 50,000)"},
    {"--poisson", "NU", PAL_FLAG_NUMBER, &args.scene.material.poisson, PAL_POISSON_MIN, PAL_POISSON_MAX,
     "Poisson's ratio (0.45)"},
    {"--density-kg-m3", "RHO", PAL_FLAG_NUMBER, &args.scene.material.density_kg_m3, PAL_DENSITY_MIN_KG_M3,
     PAL_DENSITY_MAX_KG_M3, "density (1000)"},
    {"--damping-1-s", "C", PAL_FLAG_NUMBER, &args.scene.material.damping_1_s, 0, PAL_NUMBER_MAX,
     "drag over mass (see --damping-ratio)"},
    {"--damping-ratio", "Z", PAL_FLAG_NUMBER, &args.scene.material.damping_ratio, 0, PAL_FACTOR_MAX,
     "damping of the slowest mode over the critical one, as long as the rate stays below 4 1/s (1)"},
    {"--up", "AXIS", PAL_FLAG_TEXT, &args.up, 0, 0, "x, y, z, -x, -y or -z: the direction against gravity (z)"},
    {"--axes", "LETTERS", PAL_FLAG_TEXT, &args.axes, 0, 0,
     "where x, y and z of the file point in the patient: R or L, A or P, S or I, as in RAS or LPS; the page\nshows "
     "them "
     "(those of a NIfTI scan, else not known)"},
    {"--hold", "PERCENT", PAL_FLAG_NUMBER, &args.hold_percent, 0.1, 100,
     "lowest part of the height that is fixed (5; an open adaptive surface: its open edges)"},
    {"--appearance", PAL_APPEARANCES, PAL_FLAG_WORD, &args.scene.appearance, 0, 0,
     "what the body looks like in the viewer (the one in its name, else neutral)"},
    {"--gravity", NULL, PAL_FLAG_SWITCH, &args.scene.gravity, 0, 0,
     "add gravity (a scanned shape is already in balance with its weight)"},
    {"--name", "NAME", PAL_FLAG_TEXT, &args.name, 0, 0, "name of the scene, a-z 0-9 _ - (from the file name)"},
    {"--title", "TEXT", PAL_FLAG_TEXT, &args.title, 0, 0, "title in the viewer (from the file name)"},
    {"--source", "TEXT", PAL_FLAG_TEXT, &args.source, 0, 0, "origin of the data, shown in the viewer"},
    {"--tetgen", NULL, PAL_FLAG_SWITCH, &args.tetgen, 0, 0, "write TetGen files for any size"},
    {"--no-tetgen", NULL, PAL_FLAG_SWITCH, &args.no_tetgen, 0, 0, "write no TetGen files"},
};

int command_prepare(int argc, char **argv)
{
    const pal_flag_table table = {.usage = "prepare IN -o DIR [flags]",
                                  .about = about,
                                  .example = "palpate prepare --procedural -o organ\n"
                                             "palpate prepare deploy/problems/gear.obj --model fem --hold 12 -o gear\n"
                                             "palpate prepare --shape stomach -o stomach\n",
                                  PAL_FLAGS(flag),
                                  .operands = {0, 1}};
    pal_flag_common common;
    const char *in[1] = {NULL};
    int n_in = 0, code = pal_flags_parse(&table, argc, argv, &common, in, &n_in);
    if (code >= 0) return code;
    if (args.procedural && args.scene.shape)
        return pal_flags_wrong(&common, "--procedural and --shape exclude each other");
    if ((args.procedural || args.scene.shape) == (n_in > 0))
        return pal_flags_wrong(&common, "needs either a file or --procedural or --shape");
    if (args.list_labels)
        return n_in ? list_labels(&common, in[0]) : pal_flags_wrong(&common, "--list-labels needs a file");
    if (!args.folder || !*args.folder) return pal_flags_wrong(&common, "needs -o DIR");
    const char *sentence = check_model(&args);
    if (sentence) return pal_flags_wrong(&common, "%s", sentence);
    if (args.tetgen && args.no_tetgen) return pal_flags_wrong(&common, "--tetgen and --no-tetgen exclude each other");
    if (args.up && !read_axis(args.up, args.scene.up))
        return pal_flags_wrong(&common, "--up: is not x, y, z, -x, -y or -z");
    if (args.threshold && !read_threshold(args.threshold, &args.scene))
        return pal_flags_wrong(&common, "--threshold: is not LOW,HIGH, two whole numbers that ascend, as 200,3000");
    if (args.threshold && args.scene.label >= 0)
        return pal_flags_wrong(&common, "--threshold and --label exclude each other");
    const char *fault = args.axes ? pal_anatomical_axes_fault(args.axes) : NULL;
    if (fault) return pal_flags_wrong(&common, "--axes: %.20s %s", args.axes, fault);
    if (args.axes) snprintf(args.scene.axes, sizeof args.scene.axes, "%.3s", args.axes);
    pal_material *m = &args.scene.material;
    if (m->young_Pa == 0) m->young_Pa = args.scene.adaptive ? PAL_WALL_YOUNG_PA : PAL_SOLID_YOUNG_PA;
    args.scene.hold = args.hold_percent / 100;
    args.scene.thickness_m = args.thickness_mm / 1000;
    if (args.units && !(args.scene.unit_m = pal_mesh_unit_named(args.units)))
        return pal_flags_wrong(&common, "--units: is not m, cm, mm, um or in");
    return run(&common, in[0], &args);
}
