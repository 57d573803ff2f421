/* Studies as table, plot and page. */
#include "server/study/study_page.h"

#include "server/figure/plot.h"
#include "server/mesh/files/file_bytes.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

enum { METHODS = 12, FRONT_LABELS = 40, TIP = 2 * PAL_CONFIGURATION_TEXT };

/* as the command writes its loads (study_input.c) */
static bool is_quick(const pal_study_file *file)
{
    return strstr(file->loads, ", quick") != NULL;
}

/* ---- table ---- */

typedef enum column_kind { NUMBER, COUNT, LIVE } column_kind;
/* what a number is divided by: the largest displacement, the largest force */
typedef enum column_of { ITSELF, DISPLACEMENT, FORCE } column_of;
/* a column of figures; printed: heading and width on the terminal, 0: on the page only */
typedef struct column {
    const char *name, *printed;
    int width;
    column_kind kind;
    size_t at;
    double scale;
    column_of of;
    const char *format;
} column;
#define AT(member) offsetof(pal_study_point, member)
static const column columns[] = {
    {"ms", "ms", 8, NUMBER, AT(measured.ms), 1, ITSELF, "%.3f"},
    {"ms p95", "", 0, NUMBER, AT(ms_p95), 1, ITSELF, "%.3f"},
    {"live", "live", 5, LIVE, 0, 1, ITSELF, ""},
    {"error mm", "", 0, NUMBER, AT(measured.error_m), 1e3, ITSELF, "%.4f"},
    {"rest RMS mm", "", 0, NUMBER, AT(static_rms_m), 1e3, ITSELF, "%.4f"},
    {"rest mm", "rest mm", 8, NUMBER, AT(static_max_m), 1e3, ITSELF, "%.4f"},
    {"rest RMS %", "", 0, NUMBER, AT(static_rms_m), 1e2, DISPLACEMENT, "%.2f"},
    {"rest %", "rest %", 6, NUMBER, AT(static_max_m), 1e2, DISPLACEMENT, "%.2f"},
    {"path RMS mm", "", 0, NUMBER, AT(trajectory_rms_m), 1e3, ITSELF, "%.4f"},
    {"path mm", "path mm", 8, NUMBER, AT(trajectory_max_m), 1e3, ITSELF, "%.4f"},
    {"force 0 ms RMS %", "", 0, NUMBER, AT(force_rms_N[0]), 1e2, FORCE, "%.1f"},
    {"force 0 ms %", "", 0, NUMBER, AT(force_max_N[0]), 1e2, FORCE, "%.1f"},
    {"force 50 ms RMS %", "force %", 7, NUMBER, AT(force_rms_N[1]), 1e2, FORCE, "%.1f"},
    {"force 50 ms %", "", 0, NUMBER, AT(force_max_N[1]), 1e2, FORCE, "%.1f"},
    {"force 200 ms RMS %", "", 0, NUMBER, AT(force_rms_N[2]), 1e2, FORCE, "%.1f"},
    {"force 200 ms %", "", 0, NUMBER, AT(force_max_N[2]), 1e2, FORCE, "%.1f"},
    {"force 50 ms, 30 Hz RMS %", "", 0, NUMBER, AT(force_rms_N[3]), 1e2, FORCE, "%.1f"},
    {"force 50 ms, 30 Hz %", "", 0, NUMBER, AT(force_max_N[3]), 1e2, FORCE, "%.1f"},
    {"nodes", "nodes", 7, COUNT, AT(n_node), 1, ITSELF, "%.0f"},
    {"sub-steps", "steps", 6, COUNT, AT(n_substep), 1, ITSELF, "%.0f"},
    {"made in s", "", 0, NUMBER, AT(prepare_s), 1, ITSELF, "%.2f"},
    {"predicted ms", "", 0, NUMBER, AT(predicted_ms), 1, ITSELF, "%.3f"},
    {"predicted mm", "", 0, NUMBER, AT(predicted_m), 1e3, ITSELF, "%.4f"},
};
enum { N_COLUMN = sizeof columns / sizeof *columns };

/* text of a cell; an unknown number becomes `unknown` */
static const char *cell_text(const pal_study *s, const pal_study_point *p, const column *c, const char *unknown,
                             char out[32])
{
    const void *at = (const char *)p + c->at;
    if (c->kind == LIVE) return !pal_study_measured(p) ? "" : 1e-3 * p->measured.ms <= s->step_s ? "yes" : "no";
    double value = c->scale * (c->kind == COUNT ? *(const int *)at : *(const double *)at);
    if (c->of == DISPLACEMENT) value /= s->max_m;
    if (c->of == FORCE) value /= s->max_force_N;
    if (!isfinite(value)) return unknown;
    snprintf(out, 32, c->format, value);
    return out;
}

static const char *reason_of(const pal_study_point *p)
{
    return p->reason[0] ? p->reason : pal_err_text(p->err);
}

/* the tolerance of most configurations; 0: none has one */
static double usual_tolerance(const pal_study *study)
{
    double usual = 0;
    int max = 0;
    for (int k = 0; k < study->n_point; k++) {
        double t = study->point[k].measured.configuration.tolerance;
        int n = 0;
        for (int i = 0; i < study->n_point; i++) n += study->point[i].measured.configuration.tolerance == t;
        if (t > 0 && n > max) max = n, usual = t;
    }
    return usual;
}

/* takes the first `part` out of text */
static void leave_out(char *text, const char *part)
{
    char *at = strstr(text, part);
    if (at) memmove(at, at + strlen(part), strlen(at + strlen(part)) + 1);
}

/* a configuration without what most of them have, so that a row fits a terminal of 120 columns */
static const char *row_text(const pal_configuration *configuration, double usual, char out[PAL_CONFIGURATION_TEXT])
{
    char tolerance[48];
    pal_configuration_text(configuration, out);
    leave_out(out, " corotational");
    snprintf(tolerance, sizeof tolerance, ", tolerance %g", usual);
    if (configuration->tolerance == usual) leave_out(out, tolerance);
    return out;
}

void pal_study_print(const pal_study_file *file, FILE *to)
{
    const double usual = usual_tolerance(&file->study);
    const pal_study *s = &file->study;
    int order[PAL_STUDY_POINTS];
    char text[PAL_CONFIGURATION_TEXT], cell[32];
    fprintf(to, "%s: %s on %s\n", s->name, file->loads, s->machine);
    fprintf(to, "against %s, itself within %.3g mm;\nthe largest displacement %.4g mm\n", s->reference,
            1e3 * s->reference_m, 1e3 * s->max_m);
    if (!pal_study_trusted(s))
        fprintf(to,
                "So much that no configuration is named: hold more of the body (palpate prepare --hold 20, with --up "
                "as it lies)%s.\n",
                is_quick(file) ? ", or study it without --quick" : "");
    if (is_quick(file))
        fputs("Quick: a coarse reference, so errors below that are of chance, and few configurations;\n"
              "for figures to be used run it without --quick.\n",
              to);
    fprintf(to, "%1s %3s", "", "row");
    for (int c = 0; c < N_COLUMN; c++)
        if (columns[c].width > 0) fprintf(to, " %*s", columns[c].width, columns[c].printed);
    fprintf(to, "  configuration\n");
    pal_study_order(s, order);
    for (int k = 0; k < s->n_point; k++) {
        const pal_study_point *p = &s->point[order[k]];
        if (!pal_study_measured(p)) continue;
        fprintf(to, "%1s %3d", p->measured.front ? "*" : "", k + 1);
        for (int c = 0; c < N_COLUMN; c++)
            if (columns[c].width > 0) fprintf(to, " %*s", columns[c].width, cell_text(s, p, &columns[c], "-", cell));
        fprintf(to, "  %s\n", row_text(&p->measured.configuration, usual, text));
        if (p->reason[0]) fprintf(to, "      %s\n", p->reason);
    }
    fprintf(
        to,
        "* the front: nothing else is both cheaper and nearer; an error below the reference's own counts as that.\n"
        "ms: of a step of %.3g ms, or of the shorter ones in it. live: no more than that. steps: sub-steps of one.\n"
        "rest, path: largest error at rest under load, and on the way there.\n",
        1e3 * s->step_s);
    if (usual > 0)
        fprintf(to, "Tolerance %g unless a row says another; fem is corotational unless it says another law.\n", usual);
    if (s->max_force_N > 0)
        fprintf(
            to,
            "force: RMS difference of the force felt in a press, in per cent of the largest, %.3g N, with 60 models a\n"
            "second and a round trip of 50 ms. The reference's own changes by %.2g %% from a mesh 1.4 times coarser.\n",
            s->max_force_N, 100 * s->reference_force_N / s->max_force_N);
    fprintf(to, "The files have all figures.\n");
    for (int k = 0; k < s->n_point; k++) {
        const pal_study_point *p = &s->point[order[k]];
        if (!pal_study_measured(p))
            fprintf(to, "not measured: %d, %s: %s\n", k + 1, pal_configuration_text(&p->measured.configuration, text),
                    reason_of(p));
    }
}

/* ---- plot ---- */

/* the parameters of a point on the front, as short as its marker allows */
static void parameters_of(const pal_study *study, const pal_study_point *p, double usual, char *out, size_t n_byte)
{
    const pal_configuration *s = &p->measured.configuration;
    bool voxels = !strcmp(s->model, "fem") || !strcmp(s->model, "tet_springs");
    int n = s->size > 0 ? snprintf(out, n_byte, "%d %s", s->size,
                                   voxels         ? "voxels"
                                   : s->size == 1 ? "level"
                                                  : "levels")
                        : snprintf(out, n_byte, "as it is");
    bool refined = !strcmp(s->element, "refined");
    if (refined) n += snprintf(out + n, n_byte - (size_t)n, " refined");
    bool law = s->law[0] && strcmp(s->law, "corotational") != 0, other = !strcmp(s->solver, "sdirk2");
    n += snprintf(out + n, n_byte - (size_t)n, "%s%s%s", law ? " " : "", law ? s->law : "", other ? " sdirk2" : "");
    double step = s->step_s > 0 ? s->step_s : study->step_s;
    if ((size_t)n < n_byte && fabs(step - study->step_s) > 1e-9 && step > 0)
        n += snprintf(out + n, n_byte - (size_t)n, ", 1/%.4g s", 1 / step);
    if (s->tolerance > 0 && s->tolerance != usual && (size_t)n < n_byte)
        snprintf(out + n, n_byte - (size_t)n, ", to %.0e", s->tolerance);
}

typedef struct series {
    char name[METHODS][PAL_CONFIGURATION_TEXT];
    int n_method, n[METHODS], n_front;
    bool apart[METHODS]; /* excluded from the front, as their `reason` states */
    double x[METHODS][PAL_STUDY_POINTS], y[METHODS][PAL_STUDY_POINTS];
    const char *tip[METHODS][PAL_STUDY_POINTS];
    char tip_text[PAL_STUDY_POINTS][TIP];
    int n_tip;
    double front_x[PAL_STUDY_POINTS], front_y[PAL_STUDY_POINTS];
    char parameters[FRONT_LABELS][64], title[160], x_label[96], live[64], own[80];
    pal_plot_label label[FRONT_LABELS];
    int n_label;
    double usual; /* tolerance that labels omit */
} series;

enum { FORCE_LINK = 1 }; /* of the force plot: 60 Hz, 50 ms */

static double force_percent(const pal_study *study, const pal_study_point *p, int link)
{
    return 100 * p->force_rms_N[link] / study->max_force_N;
}

/* of: DISPLACEMENT or FORCE */
static void add_point(series *s, const pal_study *study, const pal_study_point *p, column_of of)
{
    char name[PAL_CONFIGURATION_TEXT];
    int k = 0;
    bool apart = p->reason[0] != 0;
    /* "fem hex8_bbar", "tet_springs calibrated": the methods with separate markers */
    const pal_configuration *c = &p->measured.configuration;
    snprintf(name, sizeof name, "%s%s%s%s", c->model, c->element[0] ? " " : "", c->element,
             c->k_distance_J > 0 ? " calibrated" : "");
    while (k < s->n_method && (strcmp(s->name[k], name) != 0 || s->apart[k] != apart)) k++;
    if (k == s->n_method) {
        if (s->n_method == METHODS) return;
        s->apart[k] = apart;
        memcpy(s->name[s->n_method++], name, sizeof name);
    }
    char *tip = s->tip_text[s->n_tip++], text[PAL_CONFIGURATION_TEXT];
    const double ms = p->measured.ms, error_mm = 1e3 * p->measured.error_m;
    if (of == FORCE)
        snprintf(tip, TIP, "%s: %.3g ms, force %.3g, %.3g, %.3g %% at 0, 50, 200 ms", pal_configuration_text(c, text),
                 ms, force_percent(study, p, 0), force_percent(study, p, 1), force_percent(study, p, 2));
    else
        snprintf(tip, TIP, "%s: %.3g ms, %.3g mm%s%s", pal_configuration_text(c, text), ms, error_mm, apart ? "; " : "",
                 p->reason);
    s->tip[k][s->n[k]] = tip;
    s->x[k][s->n[k]] = ms, s->y[k][s->n[k]++] = of == FORCE ? force_percent(study, p, FORCE_LINK) : error_mm;
    if (!p->measured.front || of == FORCE) return;
    s->front_x[s->n_front] = ms, s->front_y[s->n_front++] = error_mm;
    if (s->n_label == FRONT_LABELS) return;
    parameters_of(study, p, s->usual, s->parameters[s->n_label], sizeof *s->parameters);
    s->label[s->n_label] = (pal_plot_label){ms, error_mm, s->parameters[s->n_label]};
    s->n_label++;
}

/* the error of the displacement, or of the force, against milliseconds */
static pal_err draw(const pal_study_file *file, column_of of, char **svg, size_t *n_byte, pal_diagnostic *diag)
{
    const pal_study *study = &file->study;
    int order[PAL_STUDY_POINTS];
    series *s = calloc(1, sizeof *s);
    if (!s) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a drawing");
    pal_study_order(study, order);
    s->usual = usual_tolerance(study);
    for (int k = 0; k < study->n_point; k++)
        if (pal_study_measured(&study->point[order[k]]) &&
            (of != FORCE || isfinite(force_percent(study, &study->point[order[k]], FORCE_LINK))))
            add_point(s, study, &study->point[order[k]], of);
    snprintf(s->title, sizeof s->title, "%s: what accuracy costs", study->name);
    snprintf(s->live, sizeof s->live, "real time, %.3g ms", 1e3 * study->step_s);
    snprintf(s->x_label, sizeof s->x_label, "milliseconds of computing for %.3g ms of the body's time, median",
             1e3 * study->step_s);
    snprintf(s->own, sizeof s->own, "the reference itself, %.2g mm", 1e3 * study->reference_m);
    pal_plot plot = {.title = s->title,
                     .x_label = s->x_label,
                     .y_label = "largest error, mm",
                     .log_x = true,
                     .log_y = true,
                     .wide = 980,
                     .high = 560,
                     .n_guide = 2,
                     .n_label = s->n_label,
                     .label = s->label};
    plot.guide[0] = (pal_plot_guide){.vertical = true, .at = 1e3 * study->step_s, .text = s->live};
    plot.guide[1] = (pal_plot_guide){.at = 1e3 * study->reference_m, .text = s->own};
    if (of == FORCE) {
        snprintf(s->own, sizeof s->own, "the reference itself from a mesh 1.4 times coarser");
        plot.guide[1].at = 100 * study->reference_force_N / study->max_force_N;
        plot.n_guide = plot.guide[1].at > 0 ? 2 : 1;
        plot.y_label = "RMS error of the force felt, % of the largest (60 models a second, 50 ms round trip)";
    } else {
        plot.curve[plot.n_curve++] = (pal_curve){
            .name = "the front", .n = s->n_front, .x = s->front_x, .y = s->front_y, .bare = true, .ink = true};
    }
    bool any_apart = false;
    for (int k = 0; k < s->n_method; k++) {
        any_apart = any_apart || s->apart[k];
        plot.curve[plot.n_curve++] = (pal_curve){.name = s->name[k],
                                                 .n = s->n[k],
                                                 .x = s->x[k],
                                                 .y = s->y[k],
                                                 .tip = s->tip[k],
                                                 .hollow = s->apart[k],
                                                 .dots = true};
    }
    if (any_apart && of != FORCE)
        plot.y_label = "largest error, mm (hollow: excluded from the front; its tip says why)";
    pal_err err = pal_plot_text(&plot, svg, n_byte, diag);
    free(s);
    return err;
}

/* ---- page ---- */

static void put_text(FILE *to, const char *text)
{
    pal_svg_escape(to, text, strlen(text));
}

static void put_fact(FILE *to, const char *name, const char *text)
{
    fprintf(to, "<dt>%s</dt><dd>", name);
    put_text(to, text);
    fputs("</dd>\n", to);
}

/* End of a word of a command, which may be quoted; returns the start of the next word. */
static const char *word_end(const char *at)
{
    for (bool quoted = false; *at && (quoted || *at != ' '); at++)
        if (*at == '\'') quoted = !quoted;
    while (*at == ' ') at++;
    return at;
}

/* The command of a study without options that request a configuration, a restart or another output. */
static void put_study(FILE *to, const pal_study_file *file)
{
    static const char *const apart[] = {"--within", "--budget", "--pick", "-o", "--again", "--json", "--quiet"};
    char text[sizeof file->command + 2];
    for (const char *at = file->command, *next; *at; at = next) {
        next = word_end(at);
        bool left = false;
        for (int k = 0; k < 7 && !left; k++) {
            size_t n = strlen(apart[k]);
            left = !strncmp(at, apart[k], n) && (at[n] == 0 || at[n] == ' ' || at[n] == '=');
            /* with its value */
            if (left && k < 4 && at[n] == ' ') next = word_end(next);
        }
        if (left) continue;
        snprintf(text, sizeof text, "%.*s%s", (int)(next - at), at, *next || next[-1] == ' ' ? "" : " ");
        put_text(to, text);
    }
}

static void put_row(FILE *to, const pal_study_file *file, const pal_study_point *p, int row)
{
    char text[PAL_CONFIGURATION_TEXT], cell[32];
    bool measured = pal_study_measured(p);
    fprintf(to, "<tr%s><td>%s</td><td class=\"n\">",
            p->measured.front ? " class=\"front\""
            : measured        ? ""
                              : " class=\"bad\"",
            p->measured.front ? "&#9733;" : "");
    fprintf(to, measured ? "<button>%d</button></td><td>" : "%d</td><td>", row);
    put_text(to, pal_configuration_text(&p->measured.configuration, text));
    /* the command that writes its scene */
    if (p->measured.front) {
        fputs("<br><code>", to);
        put_study(to, file);
        fprintf(to, "--pick %d -o NEW</code>", row);
    }
    if (!measured || p->reason[0]) {
        fputs("<br>", to);
        put_text(to, reason_of(p));
    }
    fputs("</td>", to);
    for (int c = 0; c < N_COLUMN; c++)
        fprintf(to, "<td class=\"n\">%s</td>", cell_text(&file->study, p, &columns[c], "", cell));
    fputs("</tr>\n", to);
}

static const char head[] =
    "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
    "<meta name=\"viewport\" content=\"width=device-width\">\n<style>\n"
    "body{font:15px/1.45 system-ui,sans-serif;color:#222;max-width:1180px;margin:1.5em auto;padding:0 1em}\n"
    "h1{font-size:1.5em;margin:0 0 "
    ".5em}svg{max-width:100%;min-width:760px;height:auto}code{font-size:12px;color:#555;user-select:all}\n"
    "dl{display:grid;grid-template-columns:max-content 1fr;gap:.15em 1em;margin:0 0 1em}dt{color:#666}dd{margin:0}\n"
    ".wide{overflow-x:auto}table{border-collapse:collapse;font-size:13px}\n"
    "th,td{padding:.2em .6em;text-align:left;border-bottom:1px solid #ddd;vertical-align:top}\n"
    "th{cursor:pointer;white-space:nowrap;position:sticky;top:0;background:#fff}td{white-space:nowrap}\n"
    "th:nth-child(n+4),td:nth-child(n+4){text-align:right}button{font:inherit;min-width:2.6em;cursor:pointer}\n"
    "#copied{position:sticky;top:0;z-index:1;background:#fff;min-height:1.45em;margin:.5em 0}\n"
    "td.n{text-align:right;font-variant-numeric:tabular-nums}\n"
    "tr.front{background:#fff6dc}tr.bad{color:#888}tr.bad td{white-space:normal}p{color:#555}\n</style>\n<title>";

/* A click on a heading sorts by it, a second click reverses the order. Empty cells stay last. The button of a row
 * copies its command, also from a local file, where some browsers limit the clipboard to the selection. */
static const char sorting[] =
    "<script>\ndocument.querySelectorAll('th').forEach((th,c)=>th.addEventListener('click',()=>{\n"
    "const body=document.querySelector('tbody'),way=th.dataset.way==='1'?-1:1;th.dataset.way=String(way);\n"
    "const key=r=>r.cells[c].textContent.trim();\n"
    "const rows=[...body.rows].sort((a,b)=>{const s=key(a),t=key(b);if(!s||!t)return s?-1:t?1:0;\n"
    "const n=Number(s)-Number(t);return way*(Number.isNaN(n)?s.localeCompare(t):n)});\n"
    "body.append(...rows)}));\n"
    "const copied=document.querySelector('#copied');\n"
    "document.querySelectorAll('button').forEach(b=>b.addEventListener('click',async()=>{\n"
    "const line=copied.dataset.study+'--pick '+b.textContent+' -o NEW';let done=true;\n"
    "copied.innerHTML='<span></span> <code></code>';copied.lastChild.textContent=line;\n"
    "try{await navigator.clipboard.writeText(line)}catch{getSelection().selectAllChildren(copied.lastChild);\n"
    "done=document.execCommand('copy')}\n"
    "copied.firstChild.textContent=done?'copied:':'to be copied:'}));\n</script>\n";

static void put_page(FILE *to, const pal_study_file *file, const char *svg, const char *force_svg)
{
    const pal_study *s = &file->study;
    char text[200];
    int order[PAL_STUDY_POINTS];
    fputs(head, to);
    put_text(to, s->name);
    fputs(": what accuracy costs</title></head><body>\n<h1>", to);
    put_text(to, s->name);
    fputs(": what accuracy costs</h1>\n<dl>\n", to);
    put_fact(to, "machine", s->machine);
    put_fact(to, "reference", s->reference);
    snprintf(text, sizeof text, "%.3g mm; the largest displacement %.4g mm, the body %.4g mm across",
             1e3 * s->reference_m, 1e3 * s->max_m, 1e3 * s->length_scale_m);
    put_fact(to, "its own error", text);
    if (is_quick(file)) put_fact(to, "quick", "a coarse reference: errors below its own are of chance");
    put_fact(to, "loads", file->loads);
    snprintf(text, sizeof text, "%d of %d%s", s->n_point, file->n_total, file->whole ? "" : ", broken off");
    put_fact(to, "configurations", text);
    put_fact(to, "made by", file->command);
    fputs("</dl>\n", to);
    if (svg)
        fprintf(to, "<div class=\"wide\">%s</div>\n", svg);
    else
        fputs("<p>Nothing was measured, so there is nothing to draw.</p>\n", to);
    if (force_svg)
        fprintf(to,
                "<div class=\"wide\">%s</div>\n<p>Force: what a device renders from the models of each "
                "configuration in a press (in 1 s, held 0.5 s, out), against the reference's own force at the same "
                "pose, in per cent of its largest, %.3g N; that one changes by %.2g %% from a mesh 1.4 times "
                "coarser.</p>\n",
                force_svg, s->max_force_N, 100 * s->reference_force_N / s->max_force_N);
    fprintf(to,
            "<p>&#9733; the front: nothing else is both cheaper and nearer. ms: for %.3g ms of the body's time, with "
            "shorter steps so many of them; live: no more than that. Error: the largest distance from the reference, "
            "at rest or along the path. Point at a mark for its configuration. A row's button copies the command that "
            "writes its scene; under one of the front it is shown as well.</p>\n",
            1e3 * s->step_s);
    fputs("<p id=\"copied\" data-study=\"", to);
    put_study(to, file);
    fputs("\"></p>\n<div class=\"wide\"><table><thead><tr><th></th><th>row</th><th>configuration</th>", to);
    for (int c = 0; c < N_COLUMN; c++) fprintf(to, "<th>%s</th>", columns[c].name);
    fputs("</tr></thead><tbody>\n", to);
    pal_study_order(s, order);
    for (int k = 0; k < s->n_point; k++) put_row(to, file, &s->point[order[k]], k + 1);
    fputs("</tbody></table></div>\n", to);
    fputs(sorting, to);
    fputs("</body></html>\n", to);
}

pal_err pal_study_publish(const pal_study_file *file, const char *stem, pal_diagnostic *diag)
{
    static const char *const ending[2] = {"", "_force"};
    char path[PAL_STUDY_PATH + 16], *svg[2] = {NULL, NULL};
    snprintf(path, sizeof path, "%s.csv", stem);
    PAL_TRY(pal_study_file_csv(file, path, diag));
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < 2 && !err; k++) {
        size_t n_byte = 0;
        /* refused: no point to draw */
        err = draw(file, k ? FORCE : DISPLACEMENT, &svg[k], &n_byte, diag);
        if (err == PAL_ERR_REFUSED) err = PAL_ERR_OK;
        snprintf(path, sizeof path, "%s%s.svg", stem, ending[k]);
        if (!err && svg[k]) err = pal_file_write(path, svg[k], n_byte, diag);
    }
    snprintf(path, sizeof path, "%s.html", stem);
    pal_file_out page;
    if (!err && !(err = pal_file_begin(&page, path, diag))) {
        put_page(page.file, file, svg[0], svg[1]);
        err = pal_file_end(&page, diag);
    }
    free(svg[0]);
    free(svg[1]);
    return err;
}
