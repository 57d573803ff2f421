/* Control cells of named solids: the kept cells of a lattice, and the map that gives it its shape. Lattice lines have a
 * table of lengths where the steps are not equal; all lengths in metres. */
#include "server/mesh/cells/cell_models.h"

#include "server/mesh/cells/cell_lattice.h"

#include <math.h>
#include <string.h>

/* the length of a table's line t, straight between lines and beyond the ends */
static double line_at(const double *line, int n_line, double t)
{
    int i = (int)fmax(0, fmin(n_line - 2, floor(t)));
    return line[i] + (line[i + 1] - line[i]) * (t - i);
}
#define LINE(table, t) line_at(table, (int)(sizeof table / sizeof table[0]), t)

/* rotates x about the axis through the centre, counter-clockwise seen from the tip of the axis */
static void turn(double x[3], int axis, const double centre[3], double angle)
{
    int a = (axis + 1) % 3, b = (axis + 2) % 3;
    double p = x[a] - centre[a], q = x[b] - centre[b];
    x[a] = centre[a] + cos(angle) * p - sin(angle) * q;
    x[b] = centre[b] + sin(angle) * p + cos(angle) * q;
}

static double clamp(double x, double low, double high)
{
    return fmax(low, fmin(high, x));
}

/* takes what lies beyond the cube |u| <= 1 off u */
static void take_excess(double u[3], double more[3])
{
    for (int a = 0; a < 3; a++) more[a] = u[a] - clamp(u[a], -1, 1), u[a] -= more[a];
}

/* 0 before from, 1 after to, smooth between */
static double ramp(double t, double from, double to)
{
    t = clamp((t - from) / (to - from), 0, 1);
    return t * t * (3 - 2 * t);
}

/* Inflates the cube |u| <= 1 towards its inscribed ball; completely at share 1, where edges become flat. */
static void swell(double u[3], double share)
{
    double max = fmax(fabs(u[0]), fmax(fabs(u[1]), fabs(u[2])));
    double size = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    double s = size > 0 ? pow(max / size, share) : 1;
    for (int a = 0; a < 3; a++) u[a] *= s;
}

/* soccer player: kicks a ball that his foot holds */
static const char soccer_rows[] = ".....#./.....#./...#.#./...#.#. " /* feet and ball */
                                  "./././...#.#. "                   /* shins */
                                  "./././...#.#. "                   /* thighs */
                                  "./././...###. "                   /* hips */
                                  "./././######### "                 /* shoulders */
                                  "./././....#. "                    /* neck */
                                  "./././....#.";                    /* head */

static void place_soccer(const double at[3], double x[3])
{
    static const double across[] = {-0.112, -0.088, -0.060, -0.033, -0.010, 0.010, 0.033, 0.060, 0.088, 0.112};
    static const double depth[] = {-0.112, -0.080, -0.046, -0.015, 0.015};
    static const double height[] = {0, 0.022, 0.062, 0.108, 0.138, 0.170, 0.192, 0.232};
    /* half widths of the ball, ankle, waist, neck and head against those of their lines */
    static const double ball[] = {1.9, 2.3, 0.7, 1, 1}, width[] = {1, 1, 1, 0.95, 1, 1.1, 2.5, 2.1};
    static const double thick[] = {0.9, 0.75, 0.9, 1.1, 1.0, 0.8, 1.5, 1.3};
    const double leg_x = 0.0215, hip[3] = {0, 0, 0.112}, knee[3] = {0, 0, 0.062};
    x[0] = LINE(across, at[0]), x[1] = LINE(depth, at[1]), x[2] = LINE(height, at[2]);
    if (at[2] <= 1 && at[0] >= 5) {
        double s = LINE(ball, at[1]);
        x[0] = leg_x + s * (x[0] - leg_x), x[2] = 0.011 + s * (x[2] - 0.011);
    }
    if (at[1] >= 3) x[1] *= LINE(thick, at[2]);
    if (at[2] >= 5 && at[0] >= 4 && at[0] <= 5) x[0] *= LINE(width, at[2]);
    /* arms get thin, one hangs, one is up */
    if (at[0] <= 2 || at[0] >= 7) {
        double side = at[0] < 5 ? -1 : 1, shoulder[3] = {side * 0.036, 0, 0.156};
        x[2] = 0.155 + 0.72 * (x[2] - 0.155), x[1] *= 0.9;
        turn(x, 1, shoulder, side * (side < 0 ? -0.5 : 0.6));
    }
    /* the right leg kicks, the left one stands behind */
    if (at[2] <= 2 && at[0] >= 5) {
        if (at[2] <= 1) turn(x, 0, knee, 0.35);
        turn(x, 0, hip, -0.85);
    } else if (at[2] <= 2) {
        turn(x, 0, hip, 0.3);
    }
}

/* sea monster: a spine that winds, all else stands out from it */
static const char monster_rows[] = "./...................##./. "                              /* chin */
                                   "#....#........#./####################./#....#........#. " /* spine and fins */
                                   "./........#.#........###/. "                              /* posts and snout */
                                   "./........###........UU./.";                              /* loop and horns */

static void place_monster(const double at[3], double x[3])
{
    enum { LINES = 23 };
    static const double angle_deg[LINES] = {-40, -40, -5, 40, 20, -25, -40, -10, 35, 15, -15, -40,
                                            -20, 15,  20, 25, 55, 85,  85,  60,  25, 0,  -15};
    static const double step[LINES - 1] = {0.015, 0.015, 0.015, 0.016, 0.017, 0.017, 0.017, 0.017, 0.015, 0.014, 0.015,
                                           0.016, 0.016, 0.016, 0.016, 0.020, 0.020, 0.020, 0.020, 0.018, 0.014, 0.015};
    static const double half[LINES] = {0.006, 0.007, 0.010, 0.015, 0.018, 0.017, 0.015, 0.014,
                                       0.015, 0.018, 0.018, 0.015, 0.016, 0.019, 0.021, 0.020,
                                       0.016, 0.013, 0.012, 0.011, 0.011, 0.009, 0.006};
    static const double wide[LINES] = {0.007, 0.008, 0.012, 0.016, 0.020, 0.019, 0.017, 0.017,
                                       0.020, 0.022, 0.022, 0.020, 0.021, 0.024, 0.024, 0.021,
                                       0.017, 0.014, 0.014, 0.016, 0.017, 0.013, 0.009};
    double t = clamp(at[0], 0, LINES - 1), place[2] = {-0.12, 0};
    /* the spine by its angle in the middle of each step */
    for (int i = 0; i < t; i++) {
        double part = fmin(1, t - i), a = M_PI / 180 * 0.5 * (angle_deg[i] + angle_deg[i + 1]);
        place[0] += part * step[i] * cos(a), place[1] += part * step[i] * sin(a);
    }
    /* what stands out further stands more upright than the spine's back */
    double a = M_PI / 180 * LINE(angle_deg, t), b = t < 16 ? 0.3 * a : a, side = at[2] - 1.5;
    double sign = side < 0 ? -1 : 1, near = fmin(0.5, fabs(side)), up = sign * 2 * near * LINE(half, t);
    double more = sign * 0.017 * (fabs(side) - near);
    x[0] = place[0] - up * sin(a) - more * sin(b), x[1] = 2 * (at[1] - 1.5) * LINE(wide, t);
    x[2] = place[1] + up * cos(a) + more * cos(b);
    /* the loop is narrow, horns are long */
    if (at[2] > 2 && at[0] < 16) x[1] *= 0.6;
    if (at[2] > 3 && at[0] > 16) x[2] += 0.02 * (at[2] - 3);
    /* fins reach out, back and down, and get thin */
    if (at[1] < 0.5 || at[1] > 2.5) {
        x[0] -= 0.016, x[1] *= 1.1, x[2] = place[1] + 0.45 * (x[2] - place[1]) - 0.014;
        if (at[0] < 2) x[1] *= 1.3, x[2] += 0.014;
    }
}

/* chair */
static const char chair_rows[] = "#...#/././#...# "         /* feet */
                                 "#...#/#...#/#####/#...# " /* stretchers */
                                 "#...#/././#...# "         /* legs */
                                 "#...#/././#...# "         /* legs */
                                 "#/#X#X#/#X#X#/# "         /* seat */
                                 "./././#.#.# "             /* posts, slat */
                                 "./././#.#.# "             /* posts, slat */
                                 "./././# "                 /* rail */
                                 "./././U...U";             /* knobs */

static void place_chair(const double at[3], double x[3])
{
    static const double across[] = {-0.042, -0.024, -0.0085, 0.0085, 0.024, 0.042};
    static const double depth[] = {-0.040, -0.023, 0, 0.023, 0.040};
    static const double height[] = {0, 0.022, 0.038, 0.054, 0.070, 0.086, 0.104, 0.122, 0.142, 0.160};
    double z = LINE(height, at[2]), splay = 1 + 0.12 * ramp(0.07 - z, 0, 0.07);
    x[0] = splay * LINE(across, at[0]), x[1] = splay * LINE(depth, at[1]), x[2] = z;
    if (z <= 0.086) return;
    /* the back leans back and its rail is bent */
    x[1] += 0.3 * (z - 0.086) + 0.008 * (1 - pow(x[0] / 0.042, 2)) * ramp(z, 0.086, 0.13);
    x[0] *= 1 + 0.1 * ramp(z, 0.09, 0.15);
}

/* head: open mouth, eyes are pyramids in their sockets, ears, a nose of brick, wedge and pyramid */
static const char head_rows[] = "./././..###../..###../. "                     /* neck */
                                "././.#####./.#####./.#####./.#####. "         /* chin */
                                "././.#...#./.#####./.#####./.#####. "         /* mouth */
                                "...S./...#./.#####./.#####./.#####./.#####. " /* nose */
                                "./...c./.#S#S#./W#####E/.#XXX#./.#####. "     /* eyes */
                                "././.#####./.#####./.#####./.#####.";         /* crown */

static void place_head(const double at[3], double x[3])
{
    static const double across[] = {-1.3, -1, -0.64, -0.2, 0.2, 0.64, 1, 1.3};
    static const double depth[] = {-1.75, -1.4, -1, -0.5, 0, 0.5, 1};
    static const double height[] = {-1.55, -1, -0.62, -0.40, 0.02, 0.42, 1};
    double u[3] = {LINE(across, at[0]), LINE(depth, at[1]), LINE(height, at[2])}, more[3];
    take_excess(u, more);
    swell(u, 0.9);
    for (int a = 0; a < 3; a++) u[a] += more[a];
    /* a chin that is narrower than the crown */
    double jaw = 1 - 0.22 * ramp(-u[2], -0.3, 1);
    x[0] = 0.078 * u[0] * jaw, x[1] = 0.092 * u[1] * (1 - 0.1 * ramp(-u[2], 0, 1)), x[2] = 0.11 * u[2];
}

/* bridge: deck on two pylons, hung from cables; gaps between all that stands */
static const char bridge_rows[] = "....#..........#././....#..........#. "       /* pylons */
                                  "....#..........#././....#..........#. "       /* pylons */
                                  "#/#/# "                                       /* deck */
                                  "#.#.#.#.#..#.#.#.#.#/./#.#.#.#.#..#.#.#.#.# " /* hangers */
                                  "#.#.#.#.#..#.#.#.#.#/./#.#.#.#.#..#.#.#.#.# " /* hangers */
                                  "#/....#..........#./#";                       /* cables */

static void place_bridge(const double at[3], double x[3])
{
    static const double half[] = {0, 0.010, 0.026, 0.036, 0.054, 0.064, 0.072, 0.088, 0.108, 0.118, 0.138, 0.150};
    static const double depth[] = {-0.034, -0.016, 0.016, 0.034};
    double from = at[0] - 10, mast = 0.080;
    x[0] = (from < 0 ? -1 : 1) * LINE(half, fabs(from));
    x[1] = LINE(depth, at[1]);
    double r = fabs(x[0]), arch = 0.006 * (1 - pow(r / 0.15, 2)), thick = 0.016;
    double cable = r < mast ? 0.080 + 0.062 * pow(r / mast, 2) : 0.074 + 0.068 * pow((0.15 - r) / (0.15 - mast), 1.4);
    const double height[] = {0, 0.024, 0.044 + arch, 0.060 + arch, 0.5 * (0.060 + arch + cable), cable, cable + thick};
    x[2] = LINE(height, at[2]);
    /* pylons are wider at their feet */
    if (at[2] < 2) x[1] *= 1 + 0.15 * (2 - at[2]);
}

/* nozzle: nine sectors of a wall that narrows and widens, and a flange */
static const char nozzle_rows[] = "#/#/# #/./. #/./. #/./. #/./. #/./. #/./. #/./. #/./.";

static void place_nozzle(const double at[3], double x[3])
{
    static const double inner[] = {0.034, 0.034, 0.032, 0.026, 0.018, 0.018, 0.024, 0.031, 0.037, 0.041};
    static const double height[] = {0, 0.016, 0.034, 0.050, 0.066, 0.082, 0.098, 0.115, 0.132, 0.15};
    double angle = 2 * M_PI * at[0] / 9, r = LINE(inner, at[2]) + 0.012 * at[1];
    x[0] = -r * cos(angle), x[1] = r * sin(angle), x[2] = LINE(height, at[2]);
}

/* kidney: a bean, hollow behind its hilum, with an artery and a ureter */
static const char kidney_rows[] = "././#./. "              /* ureter */
                                  "././#./. "              /* ureter */
                                  "..#/..#/#.#/..# "       /* lowest */
                                  "..#/..#..#/###..#/..# " /* ureter */
                                  "..#/.....#/.....#/..# " /* hilum */
                                  "..#/.....#/.....#/..# " /* hilum */
                                  "..#/###..#/..#..#/..# " /* artery */
                                  "..#/..#/..#/..#";       /* top */

static void place_kidney(const double at[3], double x[3])
{
    static const double height[] = {-2.1, -1.5, -1, -0.62, -0.26, 0, 0.26, 0.62, 1};
    double u[3] = {(at[0] - 4) / 2, (at[1] - 2) / 2, LINE(height, at[2])}, more[3];
    take_excess(u, more);
    swell(u, 0.7);
    double bean = 0.024 * u[2] * u[2];
    for (int a = 0; a < 3; a++) u[a] += more[a];
    x[0] = 0.032 * u[0] - bean, x[1] = 0.026 * u[1], x[2] = 0.058 * u[2];
}

const pal_cell_model pal_cell_model_list[PAL_CELL_MODELS] = {
    {"soccer", "a player who kicks a ball", 2, 24, 1536, {24, 76, 0}},
    {"monster", "a sea monster with fins, horns and a loop in its back", 1, 38, 320, {94, 3, 4}},
    {"block3", "a cube of 3 x 3 x 3 bricks", 2, 27, 1728, {58, 42, 0}},
    {"chair", "a chair with stretchers, slat and knobs", 1, 76, 984, {68, 3, 29}},
    {"block4", "a cube of 4 x 4 x 4 bricks", 1, 64, 512, {42, 58, 0}},
    {"head", "a head with a nose to pull", 1, 123, 1241, {82, 1, 17}},
    {"bridge", "a bridge that hangs from two pylons", 1, 150, 1200, {95, 5, 0}},
    {"nozzle", "a nozzle with a flange", 1, 99, 792, {100, 0, 0}},
    {"kidney", "a kidney, hollow behind its hilum, with artery and ureter", 1, 83, 0, {0, 0, 0}},
};

static const pal_cell_lattice lattice_list[PAL_CELL_MODELS] = {
    {{9, 4, 7}, false, soccer_rows, place_soccer, {0}, {0}},
    {{22, 3, 4}, false, monster_rows, place_monster, {0}, {0}},
    {{3, 3, 3}, false, NULL, NULL, {-0.05, -0.05, -0.05}, {0.05, 0.05, 0.05}},
    {{5, 4, 9}, false, chair_rows, place_chair, {0}, {0}},
    {{4, 4, 4}, false, NULL, NULL, {-0.05, -0.05, -0.05}, {0.05, 0.05, 0.05}},
    {{7, 6, 6}, false, head_rows, place_head, {0}, {0}},
    {{20, 3, 6}, false, bridge_rows, place_bridge, {0}, {0}},
    {{9, 3, 9}, true, nozzle_rows, place_nozzle, {0}, {0}},
    {{6, 4, 8}, false, kidney_rows, place_kidney, {0}, {0}},
};

const pal_cell_model *pal_cell_model_find(const char *name)
{
    for (int k = 0; k < PAL_CELL_MODELS; k++)
        if (!strcmp(name, pal_cell_model_list[k].name)) return &pal_cell_model_list[k];
    return NULL;
}

pal_err pal_cell_model_make(const pal_cell_model *model, pal_cells *out, pal_diagnostic *diag)
{
    return pal_cell_lattice_make(&lattice_list[model - pal_cell_model_list], out, diag);
}
