/* A load-case problem as plain structs: a body, its supports and load cases with reference answers, as the format
 * "palpate-reference-1" has them (server/scene/problem_file.h reads it, server/solve/solve.h solves it). SI.
 * Thread: [load]. */
#ifndef PAL_SIM_CORE_PROBLEM_H
#define PAL_SIM_CORE_PROBLEM_H
#include "server/sim/core/definition.h"

enum { PAL_PROBLEM_REGIONS = 8, PAL_PROBLEM_CASES = 16, PAL_PROBLEM_LOADS = 8, PAL_PROBLEM_REFERENCES = 16 };

typedef struct pal_box { /* frame of the file */
    bool all;
    double low_m[3], high_m[3];
} pal_box;

typedef struct pal_problem_material {
    char id[PAL_NAME];
    pal_box region;
    double young_Pa, poisson, density_kg_m3;
} pal_problem_material;

typedef enum pal_load_kind { PAL_LOAD_TRACTION, PAL_LOAD_POINT, PAL_LOAD_GRAVITY, PAL_LOAD_POINTS } pal_load_kind;
typedef struct pal_problem_load {
    pal_load_kind kind;
    pal_box region;  /* TRACTION: the part of the surface in the box ...                       */
    bool has_normal; /* ... that faces this way                                                */
    double normal[3];
    double traction_Pa[3], total_N[3]; /* one of them given: has_traction, has_total (traction wins) */
    bool has_traction, has_total;
    double point_m[3], force_N[3];     /* POINT: to the element around it by its shape functions    */
    double gravity_m_s2[3];            /* GRAVITY                                                  */
    int n_points;                      /* POINTS: as POINT, many; a file has none, a recording does */
    const double *points_m, *points_N; /* borrowed [n_points][3]                                   */
} pal_problem_load;

typedef struct pal_problem_support { /* every point inside is fixed, or displaced by move_m */
    pal_box region;
    bool has_normal; /* of the body's surface alone, where it faces this way */
    double normal[3];
    bool moved;
    double move_m[3];
} pal_problem_support;

typedef struct pal_problem_case {
    char id[PAL_NAME];
    int n_load;
    pal_problem_load load[PAL_PROBLEM_LOADS];
} pal_problem_case;

typedef struct pal_problem_reference {
    char id[PAL_NAME], load_case[PAL_NAME], law[PAL_NAME];
    char file[512];                      /* CSV, path as opened                          */
    bool finite;                         /* kinematics                                   */
    double young_Pa, poisson;            /* override the problem's; NaN: do not          */
    double estimated_rms, estimated_max; /* its own error, fractions; NaN: not given     */
} pal_problem_reference;

typedef struct pal_problem {
    char name[128], path[512], surface[512]; /* surface: path as opened */
    double unit_m;                           /* of the surface file's numbers; all else is in metres */
    int n_material, n_support, n_case, n_reference;
    pal_problem_material material[PAL_PROBLEM_REGIONS];
    pal_problem_support support[PAL_PROBLEM_REGIONS];
    pal_problem_case load_case[PAL_PROBLEM_CASES];
    pal_problem_reference reference[PAL_PROBLEM_REFERENCES];
} pal_problem;
#endif
