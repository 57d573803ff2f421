/* The machine that figures were measured on: its processor and cores, its memory bandwidth, and what processes hold.
 * Thread: any. */
#ifndef PAL_BASE_MACHINE_H
#define PAL_BASE_MACHINE_H
enum { PAL_MACHINE_TEXT = 128 };

/* "Xeon E5-2680 v4 @ 2.40GHz, 2 cores". What is unknown is left out; characters outside ASCII become blanks. The text
 * is the same at every call on one machine. Returns text. No errors */
const char *pal_machine_name(char text[PAL_MACHINE_TEXT]);
/* Processor time to read an array of n_byte once more, ms: the minimum of several runs. Arrays that fit into a cache
 * are read faster; below 64 KiB and above 32 MiB the rate at those sizes is used. 0: no memory for the measurement.
 * Takes some ms and heap memory */
double pal_machine_read_ms(double n_byte);
/* bytes of memory that a process has in use; 0 without /proc */
double pal_machine_resident_bytes(int process);
#endif
