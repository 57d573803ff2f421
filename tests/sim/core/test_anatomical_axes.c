/* Letters of a patient's axes against the determinant of the directions that they name, over all texts of three. */
#include "server/sim/core/anatomical_axes.h"
#include "tests/check.h"

/* of three vectors in the directions right, anterior, superior */
static double determinant(double m[3][3])
{
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

static void sets_of_the_right_hand_alone_are_taken(void)
{
    static const char letters[] = "RLAPSIX";
    int n_taken = 0, n_left = 0;
    for (int i = 0; i < 343; i++) {
        const int at[3] = {i % 7, i / 7 % 7, i / 49};
        const char text[4] = {letters[at[0]], letters[at[1]], letters[at[2]], 0};
        double m[3][3] = {{0}};
        for (int k = 0; k < 3; k++)
            if (at[k] < 6) m[k][at[k] / 2] = at[k] % 2 ? -1 : 1;
        const double volume = determinant(m); /* 0: two of a pair, or no direction */
        const char *fault = pal_anatomical_axes_fault(text);
        if (volume > 0) CHECK(!fault);
        if (volume < 0) CHECK(fault && strstr(fault, "is left-handed"));
        if (volume == 0) CHECK(fault && strstr(fault, "is not three letters"));
        n_taken += !fault;
        n_left += volume < 0;
    }
    CHECK_INT(n_taken, 24);
    CHECK_INT(n_left, 24);
}

static void other_lengths_and_small_letters_are_refused_and_nothing_is_taken(void)
{
    static const char *const bad[] = {"R", "RA", "RASL", "ras", "RAs", "R S", "left posterior superior"};
    CHECK(!pal_anatomical_axes_fault(""));
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) CHECK(pal_anatomical_axes_fault(bad[k]) != NULL);
}

int main(void)
{
    RUN(sets_of_the_right_hand_alone_are_taken);
    RUN(other_lengths_and_small_letters_are_refused_and_nothing_is_taken);
    return check_report();
}
