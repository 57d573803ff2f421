/* Anatomical directions of the scene's axes, as three letters: where +x, +y and +z point in the patient, R right or L
 * left, A anterior or P posterior, S superior or I inferior. NIfTI scans are RAS, DICOM images LPS. Thread: [any]. */
#ifndef PAL_SIM_CORE_ANATOMICAL_AXES_H
#define PAL_SIM_CORE_ANATOMICAL_AXES_H

/* room for the letters and the 0 */
enum { PAL_AXES_BYTES = 4 };

/* NULL: a text that may stand for the scene's axes; "" says that they are not known. Else the rest of a sentence about
 * it, which begins with "is": other letters, two of a pair, or left-handed axes, which would show the mirror image */
const char *pal_anatomical_axes_fault(const char *axes);
#endif
