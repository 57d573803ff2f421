/* Resolves names of load cases and references to cases with their truths. */
#include "server/calibrate/calibrate_cases.h"

#include "server/base/flags.h"
#include "server/base/vec3.h"
#include "server/calibrate/tuning.h"
#include "server/mesh/files/mesh_file.h"
#include "server/scene/problem_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ENOUGH_NODES = 700, FINEST = 64 };

typedef struct job {
    const pal_calibrate_input *input;
    pal_calibrate_cases *set;
    const pal_problem_reference *reference[PAL_CALIBRATE_CASES]; /* of each case; NULL: none   */
    bool named[PAL_CALIBRATE_CASES];                             /* it was named explicitly */
    pal_diagnostic *diag;
} job;

static bool is(const char *word, const char *what)
{
    return word && !strcmp(word, what);
}

static pal_err add_case(job *j, const char *id, bool fit)
{
    pal_calibrate_cases *s = j->set;
    const pal_problem *p = s->problem;
    const char *flag = fit ? "--case" : "--verify";
    for (int k = 0; k < s->n; k++)
        if (!strcmp(s->id[k], id))
            return PAL_REFUSE(j->diag, "%s: \"%s\" %s", flag, id,
                              fit == s->list[k].fit ? "stands there twice"
                                                    : "is fitted, so it can not verify what the fit did not see");
    if (s->n == PAL_CALIBRATE_CASES)
        return PAL_REFUSE(j->diag, "%s: \"%.40s\" is one too many, at most %d cases are taken", flag, id,
                          PAL_CALIBRATE_CASES);
    const pal_problem_reference *named = pal_problem_reference_find(p, id);
    const pal_problem_case *load_case = pal_problem_case_find(p, named ? named->load_case : id);
    if (!load_case || strlen(id) >= PAL_NAME) return pal_problem_refuse_case(p, flag, id, j->diag);
    if (named && j->input->kinematics && named->finite != is(j->input->kinematics, "finite"))
        return PAL_REFUSE(j->diag, "%s: reference \"%s\" is %s, --kinematics says %s", flag, id,
                          named->finite ? "finite" : "linear", j->input->kinematics);
    snprintf(s->id[s->n], PAL_NAME, "%s", id);
    j->reference[s->n] = named;
    j->named[s->n] = named != NULL;
    s->list[s->n++] = (pal_calibrate_case){
        .load_case = load_case, .fit = fit, .linear = named ? !named->finite : is(j->input->kinematics, "linear")};
    return PAL_ERR_OK;
}

static pal_err add_list(job *j, const char *list, bool fit)
{
    char word[256];
    while (pal_flag_next_word(&list, word, sizeof word)) PAL_TRY(add_case(j, word, fit));
    return PAL_ERR_OK;
}

/* does a list of names hold the name? */
static bool lists(const char *list, const char *name)
{
    char word[256];
    while (list && pal_flag_next_word(&list, word, sizeof word))
        if (!strcmp(word, name)) return true;
    return false;
}

static pal_err add_touches(job *j)
{
    const pal_problem *p = j->set->problem;
    for (int k = 0; k < p->n_case; k++)
        if (!lists(j->input->verify, p->load_case[k].id)) PAL_TRY(add_case(j, p->load_case[k].id, true));
    if (j->set->n > 0) return PAL_ERR_OK;
    return PAL_REFUSE(j->diag, "--verify: names every touch of the recording, so none is left to fit");
}

static bool same(double a, double b)
{
    return fabs(a - b) <= 1e-9 * fabs(b);
}

/* E and nu of a case */
static void material_of(const job *j, int index, double *young_Pa, double *poisson)
{
    const pal_problem_material *m = &j->set->problem->material[0];
    const pal_problem_reference *r = j->named[index] ? j->reference[index] : NULL;
    *young_Pa = r && !isnan(r->young_Pa) ? r->young_Pa : m->young_Pa;
    *poisson = r && !isnan(r->poisson) ? r->poisson : m->poisson;
}

/* A reference may have another material than the problem. The body then takes that material in all of its cases. */
static pal_err settle_material(job *j)
{
    pal_calibrate_cases *s = j->set;
    double young, poisson, other_young, other_poisson;
    material_of(j, 0, &young, &poisson);
    for (int k = 1; k < s->n; k++) {
        material_of(j, k, &other_young, &other_poisson);
        if (same(other_young, young) && same(other_poisson, poisson)) continue;
        return PAL_REFUSE(j->diag, "%s: \"%s\" is of E %g, nu %g and \"%s\" of E %g, nu %g: one body has one material",
                          s->problem->path, s->id[0], young, poisson, s->id[k], other_young, other_poisson);
    }
    s->problem->material[0].young_Pa = young;
    s->problem->material[0].poisson = poisson;
    return PAL_ERR_OK;
}

static bool answers(const job *j, int index, const pal_problem_reference *r)
{
    const pal_problem_material *m = &j->set->problem->material[0];
    const pal_calibrate_case *c = &j->set->list[index];
    if (strcmp(r->load_case, c->load_case->id) != 0) return false;
    if (j->input->kinematics && r->finite == c->linear) return false;
    return (isnan(r->young_Pa) || same(r->young_Pa, m->young_Pa)) &&
           (isnan(r->poisson) || same(r->poisson, m->poisson));
}

/* Chooses the reference of a case, or finite elements: finite kinematics before linear, neo-Hookean first. */
static pal_err choose_reference(job *j, int index)
{
    pal_calibrate_cases *s = j->set;
    pal_calibrate_case *c = &s->list[index];
    const pal_problem *p = s->problem;
    if (is(j->input->truth, "fem")) j->reference[index] = NULL;
    if (!is(j->input->truth, "reference")) return PAL_ERR_OK;
    for (int k = 0, best = 0; k < p->n_reference && !j->named[index]; k++) {
        const pal_problem_reference *r = &p->reference[k];
        int rank = !answers(j, index, r) ? 0 : !r->finite ? 1 : strcmp(r->law, "neo-hookean") ? 2 : 3;
        if (rank > best) j->reference[index] = r;
        best = rank > best ? rank : best;
    }
    const pal_problem_reference *r = j->reference[index];
    if (!r)
        return PAL_REFUSE(j->diag, "%s: --truth: no reference answers load case \"%s\"%s%s", p->path, s->id[index],
                          j->input->kinematics ? " with kinematics " : "",
                          j->input->kinematics ? j->input->kinematics : "");
    c->linear = !r->finite;
    return PAL_ERR_OK;
}

static pal_err read_truth(job *j, int index, const char *path, const char *name)
{
    pal_calibrate_cases *s = j->set;
    PAL_TRY(pal_samples_read(path, &s->samples[index], j->diag));
    s->list[index].samples = &s->samples[index];
    snprintf(s->truth_name[index], PAL_NAME, "%s", name);
    s->list[index].truth_name = s->truth_name[index];
    return PAL_ERR_OK;
}

/* the displacement that the recorded body had */
static pal_err take_recorded(job *j, int index)
{
    pal_calibrate_cases *s = j->set;
    const pal_recorded_load *load = &j->input->recorded->load[s->list[index].load_case - s->problem->load_case];
    size_t n = 3 * (size_t)load->n_node;
    if (!(load->speed_1_s < PAL_HELD_MAX_1_S))
        return PAL_REFUSE(j->diag,
                          "--truth: recording: \"%s\" at %.2f s moves by %.2g of its displacement in a second, so the "
                          "recording does not show where its forces lead to: fit to fem, or hold still for longer",
                          load->id, load->time_s, load->speed_1_s);
    s->samples[index] = (pal_samples){load->n_node, malloc(n * sizeof(double)), malloc(n * sizeof(double))};
    if (!s->samples[index].x || !s->samples[index].u)
        return pal_diagnostic_set(j->diag, PAL_ERR_MEMORY, "no memory for the truth of \"%s\"", load->id);
    memcpy(s->samples[index].x, load->node_x, n * sizeof(double));
    memcpy(s->samples[index].u, load->u, n * sizeof(double));
    s->list[index].samples = &s->samples[index];
    snprintf(s->truth_name[index], PAL_NAME, "recording");
    s->list[index].truth_name = s->truth_name[index];
    return PAL_ERR_OK;
}

static pal_err choose_recorded_truths(job *j)
{
    const char *truth = j->input->truth;
    if (truth && !is(truth, "fem") && !is(truth, "recording"))
        return PAL_REFUSE(j->diag, "--truth: \"%.80s\" is not fem or recording, as touches have it", truth);
    for (int k = 0; k < j->set->n && is(truth, "recording"); k++) PAL_TRY(take_recorded(j, k));
    return PAL_ERR_OK;
}

static pal_err choose_truths(job *j)
{
    if (j->input->recorded) return choose_recorded_truths(j);
    pal_calibrate_cases *s = j->set;
    const char *truth = j->input->truth;
    bool file = truth && !is(truth, "fem") && !is(truth, "reference");
    int n_fit = 0;
    for (int k = 0; k < s->n; k++) n_fit += s->list[k].fit;
    if (file && n_fit != 1)
        return PAL_REFUSE(j->diag, "--truth: %.200s is one file, --case names %d cases", truth, n_fit);
    for (int k = 0; k < s->n; k++) {
        PAL_TRY(choose_reference(j, k));
        const char *slash = file ? strrchr(truth, '/') : NULL;
        if (file && s->list[k].fit)
            PAL_TRY(read_truth(j, k, truth, slash ? slash + 1 : truth));
        else if (j->reference[k])
            PAL_TRY(read_truth(j, k, j->reference[k]->file, j->reference[k]->id));
    }
    return PAL_ERR_OK;
}

/* refuses points (frame of the file) far outside the surface's box */
static pal_err check_box(const job *j, int index)
{
    const pal_calibrate_cases *s = j->set;
    const pal_samples *samples = &s->samples[index];
    double low[3], high[3];
    pal_surface_box(&s->surface, low, high);
    double slack = PAL_MAX_OUTSIDE * pal_dist3(low, high);
    for (int i = 0; i < samples->n; i++) {
        double x[3], out = 0;
        pal_sub3(x, samples->x + 3 * i, s->surface.origin_m);
        for (int c = 0; c < 3; c++) out = fmax(out, fmax(low[c] - x[c], x[c] - high[c]));
        if (out <= slack) continue;
        const double *at = samples->x + 3 * i;
        return PAL_REFUSE(j->diag,
                          "truth \"%s\": point %d (%g, %g, %g) m is %.3g m outside of the body: is it of another one?",
                          s->truth_name[index], i + 1, at[0], at[1], at[2], out);
    }
    return PAL_ERR_OK;
}

static pal_err choose_resolution(const pal_calibrate_cases *set, pal_case_voxel_options *voxel, pal_diagnostic *diag)
{
    for (voxel->resolution = 4; voxel->resolution < FINEST; voxel->resolution += 2) {
        pal_prepared mesh = {0};
        pal_err err = pal_case_voxels(set->problem, &set->surface, voxel, &mesh, diag);
        if (err && (err != PAL_ERR_REFUSED || voxel->resolution + 2 >= FINEST)) return err;
        int n_node = err ? 0 : mesh.tets.n_node; /* refused: thinner than such voxels */
        pal_prepared_free(&mesh);
        if (n_node > ENOUGH_NODES) break;
    }
    return PAL_ERR_OK;
}

/* refuses points of a truth outside the voxels; those of a body that does not fit its voxels are within half a voxel */
static pal_err check_points(const pal_calibrate_cases *s, const pal_prepared *mesh, pal_diagnostic *diag)
{
    pal_locate *locate = NULL;
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < s->n && !err; k++) {
        const pal_samples *samples = &s->samples[k];
        int n_far = 0;
        double max = 0, out, local[4], x[3];
        if (!s->list[k].samples) continue;
        if (!locate && pal_locate_create(&mesh->tets, NULL, &locate))
            return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for points in the mesh");
        for (int i = 0; i < samples->n; i++) {
            pal_sub3(x, samples->x + 3 * i, mesh->tets.origin_m);
            pal_locate_point(locate, x, local, &out);
            n_far += out > mesh->tets.edge_m;
            max = fmax(max, out);
        }
        if (n_far > 0.01 * samples->n)
            err = PAL_REFUSE(diag,
                             "truth \"%s\": %d of %d points are more than a voxel outside of the body (by up to "
                             "%.3g m): is it of another one?",
                             s->truth_name[k], n_far, samples->n, max);
    }
    pal_locate_destroy(locate);
    return err;
}

pal_err pal_calibrate_cases_make(const pal_calibrate_cases *set, const pal_calibrate_options *options,
                                 pal_calibration **out, pal_calibration_info *info, pal_diagnostic *diag)
{
    pal_calibrate_options o = *options;
    pal_err err = o.voxel.resolution == 0 ? choose_resolution(set, &o.voxel, diag) : PAL_ERR_OK;
    if (!err) err = pal_calibration_create(set->problem, &set->surface, set->list, set->n, &o, out, diag);
    if (err) return pal_diagnostic_prefix(diag, err, set->problem->path);
    pal_calibration_info_of(*out, info);
    return check_points(set, info->mesh, diag);
}

const char *pal_calibrate_grid(const char *text, int grid[3])
{
    for (int a = 0; a < 3; a++) {
        char *end;
        long n = *text >= '0' && *text <= '9' ? strtol(text, &end, 10) : 0;
        if (n < 1 || n > 1024 || *end != (a < 2 ? 'x' : 0))
            return "--grid: is not NXxNYxNZ, three numbers of nodes from 1 to 1024, as 5x3x5";
        grid[a] = (int)n;
        text = end + 1;
    }
    return NULL;
}

pal_err pal_calibrate_cases_read(const pal_calibrate_input *input, pal_calibrate_cases *out, pal_diagnostic *diag)
{
    *out = (pal_calibrate_cases){0};
    job j = {.input = input, .set = out, .diag = diag};
    PAL_TRY(input->recorded ? pal_calibrate_recorded_problem(input, &out->problem, &out->surface, diag)
                            : pal_problem_read(input->problem, &out->problem, diag));
    for (int k = 0; k < out->problem->n_support; k++) {
        const pal_problem_support *s = &out->problem->support[k];
        if (s->moved && (s->move_m[0] != 0 || s->move_m[1] != 0 || s->move_m[2] != 0))
            return PAL_REFUSE(diag, "%s: supports[%d]: moves, springs are calibrated on supports that hold still",
                              out->problem->path, k);
    }
    PAL_TRY(input->recorded && !input->fit ? add_touches(&j) : add_list(&j, input->fit, true));
    PAL_TRY(add_list(&j, input->verify, false));
    PAL_TRY(settle_material(&j));
    PAL_TRY(choose_truths(&j));
    pal_mesh_file_options file = {.unit_m = out->problem->unit_m, .weld = PAL_MESH_WELD};
    pal_surface_report report = {0};
    if (!input->recorded)
        PAL_TRY(pal_mesh_file_read(out->problem->surface, &file, &out->surface, &report, NULL, NULL, diag));
    for (int k = 0; k < out->n; k++)
        if (out->list[k].samples) PAL_TRY(check_box(&j, k));
    return PAL_ERR_OK;
}

void pal_calibrate_cases_free(pal_calibrate_cases *set)
{
    for (int k = 0; k < PAL_CALIBRATE_CASES; k++) pal_samples_free(&set->samples[k]);
    pal_surface_free(&set->surface);
    free(set->problem);
    *set = (pal_calibrate_cases){0};
}
