/* Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0. */
/*
 * Preloaded into a user-mode Linux that is older than the processor (user_mode loads it).
 *
 * It keeps the registers of its processes in an area with room for AVX-512, and gives that back as
 * the whole set. Where the processor has more (AMX), the host refuses a part. So the part is put
 * over what the process has, and all of it given back.
 */
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

long ptrace(enum __ptrace_request request, ...)
{
  static char registers[65536] __attribute__((aligned(64)));
  va_list arguments;
  va_start(arguments, request);
  pid_t process = va_arg(arguments, pid_t);
  void *address = va_arg(arguments, void *);
  void *data = va_arg(arguments, void *);
  va_end(arguments);

  if (request == PTRACE_PEEKTEXT || request == PTRACE_PEEKDATA || request == PTRACE_PEEKUSER) {
    /* the system call stores what the function returns */
    long word;
    long result = syscall(SYS_ptrace, request, process, address, &word);
    return result < 0 ? result : word;
  }
  if (request == PTRACE_SETREGSET && address == (void *)NT_X86_XSTATE) {
    struct iovec *part = data;
    struct iovec whole = {registers, sizeof registers};
    if (syscall(SYS_ptrace, PTRACE_GETREGSET, process, address, &whole) == 0
        && part->iov_len < whole.iov_len) {
      memcpy(registers, part->iov_base, part->iov_len);
      return syscall(SYS_ptrace, request, process, address, &whole);
    }
  }
  return syscall(SYS_ptrace, request, process, address, data);
}
