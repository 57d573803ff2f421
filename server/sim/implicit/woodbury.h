/* Springs of contact in a preconditioner that knows nothing of contact. With M ~ A0, the matrix without contact, and
 * A = A0 + c W W' for a spring between a tool and the mean W'u of nodes (pal_mean_spring; a column for each axis, c its
 * stiffness times that of the system), let U = M^-1 W and B = W'U, so that A U ~ W (1 + c B). The balancing
 * preconditioner (Mandel 1993, doi:10.1002/cnm.1640090307) solves exactly for motions in U and leaves the others to M:
 *     A^-1 r ~ z + U (G^-1 U'r - B^-1 W'z),    z = M^-1 (r - W B^-1 U'r),    G = U'A U ~ B + c B B.
 * With U as it should be this is the inverse by Sherman, Morrison and Woodbury (Hager 1989, doi:10.1137/1031049); with
 * any other it stays symmetric and positive definite. Without it conjugate gradients spend an iteration or two on three
 * eigenvalues some 17 times as large as all others. Of several springs each takes those after it as part of M. U is
 * from M alone, so that for springs that hold the same tissue this is not the exact inverse.
 *
 * U costs three solves with M and changes slowly, as the body turns: a column is renewed every PAL_WOODBURY_RENEWAL_S.
 * Memory: the solver's arena, 36 bytes a dof and spring, only where some component has such springs. Thread: [load] to
 * make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_WOODBURY_H
#define PAL_SIM_IMPLICIT_WOODBURY_H
#include "server/sim/implicit/preconditioner.h"

/* springs that are corrected for: both hands of a person */
enum { PAL_WOODBURY_SPRINGS = 2 };

typedef struct pal_woodbury_spring {
    pal_mean_spring spring; /* of the present stage; revision of those that U belongs to, 0: U is not known */
    bool acts;
    float *u;                          /* columns side by side [n_dof][3][3] */
    double b_inverse[9], g_inverse[9]; /* B, G: symmetric parts */
} pal_woodbury_spring;

typedef struct pal_woodbury {
    const pal_system *system;
    int n; /* that there is memory for; 0: no component has such springs, or nodes are interpolated */
    pal_woodbury_spring spring[PAL_WOODBURY_SPRINGS];
    double left_s; /* until a column is renewed */
    int column;    /* which one */
} pal_woodbury;

/* components: those made before the solver [n_component]; MEMORY. [load] */
pal_err pal_woodbury_make(const pal_system *system, const pal_component *component, int n_component, pal_arena *arena,
                          pal_woodbury *out);
void pal_woodbury_reset(pal_woodbury *woodbury); /* nothing is known */
/* before a solve: the springs as they act now, with M at the present rotations; work [n_dof][3] */
void pal_woodbury_update(pal_woodbury *woodbury, pal_preconditioner *m, double *work);
/* p += U y with U'(r - A p) = 0: what the springs ask for at once. r [n_dof][3]: right side; p: a first guess */
void pal_woodbury_guess(const pal_woodbury *woodbury, const double *r, double *p);
/* z ~ A^-1 r; z may not be r [n_dof][3] */
void pal_woodbury_solve(const pal_woodbury *woodbury, pal_preconditioner *m, pal_cycle cycle, const double *r,
                        double *z);
void pal_woodbury_step(pal_woodbury *woodbury, double dt_s); /* once per sub-step */
#endif
