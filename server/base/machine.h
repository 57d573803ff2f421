/* What figures were measured on: processor and cores, as the system names them. Thread: any. */
#ifndef PAL_BASE_MACHINE_H
#define PAL_BASE_MACHINE_H
enum { PAL_MACHINE_TEXT = 128 };

/* "Xeon E5-2680 v4 @ 2.40GHz, 2 cores"; what is not known is left out, characters outside ASCII are blanks. The same
 * text whenever it is asked on one machine. Returns text. No errors */
const char *pal_machine_name(char text[PAL_MACHINE_TEXT]);
#endif
