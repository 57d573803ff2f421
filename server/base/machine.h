/* What figures were measured on: processor and cores, as the system names them, and how fast it reads. Thread: any. */
#ifndef PAL_BASE_MACHINE_H
#define PAL_BASE_MACHINE_H
enum { PAL_MACHINE_TEXT = 128 };

/* "Xeon E5-2680 v4 @ 2.40GHz, 2 cores"; what is not known is left out, characters outside ASCII are blanks. The same
 * text whenever it is asked on one machine. Returns text. No errors */
const char *pal_machine_name(char text[PAL_MACHINE_TEXT]);
/* Reading an array of so many bytes once more, ms of processor time: the least of some times. Arrays that fit into
 * caches are read faster than others; below 64 KiB and above 32 MiB at the rate of those. 0: no memory to find out.
 * Some ms, heap memory */
double pal_machine_read_ms(double n_byte);
#endif
