// Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
//
// The floor in C: the loop of floor.py on the C API of rcl, with the same drives and topics.
//
// Started with prefix of the topics, channel, number of drives, period in s and 0 or 1: take
// commands. Obeys "run SECONDS" like the other processes of the benches (child.py).

#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "rcl/error_handling.h"
#include "rcl/rcl.h"
#include "rcl_interfaces/msg/parameter.h"
#include "rcl_interfaces/msg/parameter_event.h"
#include "rosidl_runtime_c/string_functions.h"
#include "std_msgs/msg/float64.h"
#include "std_msgs/msg/int64.h"

#define DRIVES 128
#define VALUES 4
#define NAME 128
// of the subscriptions for commands, as the bridge has them
#define DEPTH 8
// ns between two looks at who subscribes
#define COUNT_PERIOD 50000000

static const char * const names[VALUES] = {
  "actual_speed", "motor_current", "actual_position", "digital_inputs"};

struct frame
{
  uint32_t identifier;
  uint8_t length;
  uint8_t padding[3];
  uint8_t data[8];
};

static struct
{
  rcl_publisher_t values[VALUES], response;
  bool listened[VALUES], response_listened;
  rcl_subscription_t command;
  rcl_interfaces__msg__ParameterEvent message;
  double setpoint;
} drives[DRIVES];
static int number;
static bool commanded;
static int line;

static void check(bool good, const char * what)
{
  if (!good) {
    fprintf(stderr, "floor.c: %s: %s %s\n", what, strerror(errno), rcl_get_error_string().str);
    exit(1);
  }
}

static int64_t clock_ns(clockid_t clock)
{
  struct timespec now;
  clock_gettime(clock, &now);
  return now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
}

static void advertise(
  rcl_publisher_t * publisher, rcl_node_t * node, const rosidl_message_type_support_t * type,
  const char * prefix, int drive, const char * topic)
{
  char name[NAME];
  snprintf(name, sizeof(name), "/%s%d/%s", prefix, drive, topic);
  *publisher = rcl_get_zero_initialized_publisher();
  rcl_publisher_options_t options = rcl_publisher_get_default_options();
  check(rcl_publisher_init(publisher, node, type, name, &options) == RCL_RET_OK, name);
}

static void make(int drive, rcl_node_t * node, const char * prefix)
{
  const rosidl_message_type_support_t * event =
    ROSIDL_GET_MSG_TYPE_SUPPORT(rcl_interfaces, msg, ParameterEvent);
  const rosidl_message_type_support_t * number_type =
    ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Float64);
  const rosidl_message_type_support_t * integer_type =
    ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Int64);
  rcl_interfaces__msg__ParameterEvent * message = &drives[drive].message;
  char name[NAME];
  snprintf(name, sizeof(name), "/%s%d", prefix, drive);
  check(rcl_interfaces__msg__ParameterEvent__init(message) &&
    rosidl_runtime_c__String__assign(&message->node, name) &&
    rcl_interfaces__msg__Parameter__Sequence__init(&message->changed_parameters, VALUES), name);
  for (int value = 0; value < VALUES; ++value) {
    advertise(&drives[drive].values[value], node, value < 3 ? number_type : integer_type, prefix,
      drive, names[value]);
    rcl_interfaces__msg__Parameter * entry = &message->changed_parameters.data[value];
    check(rosidl_runtime_c__String__assign(&entry->name, names[value]), name);
    entry->value.type = value < 3 ? 3 : 2;
  }
  advertise(&drives[drive].response, node, event, prefix, drive, "response");
  if (commanded) {
    snprintf(name, sizeof(name), "/%s%d/command/speed_setpoint", prefix, drive);
    rcl_subscription_options_t options = rcl_subscription_get_default_options();
    options.qos.reliability = RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
    options.qos.depth = DEPTH;
    drives[drive].command = rcl_get_zero_initialized_subscription();
    check(rcl_subscription_init(&drives[drive].command, node, number_type, name, &options) ==
      RCL_RET_OK, name);
  }
}

static bool listens(rcl_publisher_t * publisher)
{
  size_t count = 0;
  check(rcl_publisher_get_subscription_count(publisher, &count) == RCL_RET_OK, "count");
  return count > 0;
}

static void look_who_subscribes(void)
{
  for (int drive = 0; drive < number; ++drive) {
    for (int value = 0; value < VALUES; ++value) {
      drives[drive].listened[value] = listens(&drives[drive].values[value]);
    }
    drives[drive].response_listened = listens(&drives[drive].response);
  }
}

static void ask(int drive)
{
  std_msgs__msg__Float64 message;
  for (int count = 0; commanded && count < DEPTH &&
    rcl_take(&drives[drive].command, &message, NULL, NULL) == RCL_RET_OK; ++count)
  {
    drives[drive].setpoint = message.data;
  }
  rcl_reset_error();
  struct frame frame = {.identifier = UINT32_C(0x80000000) | (drive + 1) << 21 | 0x001FFFF0,
    .length = 8};
  int raw = (int)(drives[drive].setpoint * 10.0);
  frame.data[0] = raw >> 8 & 0xFF;
  frame.data[1] = raw & 0xFF;
  check(send(line, &frame, sizeof(frame), 0) == sizeof(frame), "send");
}

static void publish(rcl_publisher_t * publisher, const void * message)
{
  check(rcl_publish(publisher, message, NULL) == RCL_RET_OK, "publish");
}

static void answered(void)
{
  static const double scale[VALUES] = {0.1, 0.01, 0.1, 1.0};
  struct frame frame;
  check(recv(line, &frame, sizeof(frame), 0) == sizeof(frame), "a drive did not answer");
  int drive = (int)((frame.identifier & 0x0FFFFFFF) >> 21) - 1;
  check(drive >= 0 && drive < number, "a frame of nobody");
  rcl_interfaces__msg__ParameterEvent * message = &drives[drive].message;
  int64_t now = clock_ns(CLOCK_REALTIME);
  message->stamp.sec = (int32_t)(now / 1000000000);
  message->stamp.nanosec = (uint32_t)(now % 1000000000);
  rcl_interfaces__msg__Parameter * entries = message->changed_parameters.data;
  for (int value = 0; value < VALUES; ++value) {
    int16_t raw = (int16_t)(frame.data[2 * value] << 8 | frame.data[2 * value + 1]);
    if (value < 3) {
      entries[value].value.double_value = raw * scale[value];
    } else {
      entries[value].value.integer_value = (uint16_t)raw;
    }
  }
  if (drives[drive].response_listened) {
    publish(&drives[drive].response, message);
  }
  for (int value = 0; value < VALUES; ++value) {
    if (drives[drive].listened[value]) {
      // a message of one number is that number
      publish(&drives[drive].values[value], value < 3 ?
        (void *)&entries[value].value.double_value : (void *)&entries[value].value.integer_value);
    }
  }
}

static void run(double duration, int64_t period)
{
  int64_t deadline = clock_ns(CLOCK_MONOTONIC), look_at = 0;
  int64_t end = deadline + (int64_t)(1e9 * duration), cpu = clock_ns(CLOCK_PROCESS_CPUTIME_ID);
  long exchanges = 0;
  while (deadline < end) {
    struct timespec until = {deadline / 1000000000, deadline % 1000000000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
    if (deadline >= look_at) {
      look_who_subscribes();
      look_at = deadline + COUNT_PERIOD;
    }
    for (int drive = 0; drive < number; ++drive) {
      ask(drive);
    }
    for (int drive = 0; drive < number; ++drive, ++exchanges) {
      answered();
    }
    deadline += period;
  }
  printf("{\"cpu\": %.9f, \"exchanges\": %ld}\n",
    1e-9 * (clock_ns(CLOCK_PROCESS_CPUTIME_ID) - cpu), exchanges);
}

int main(int count, char * words[])
{
  check(count == 6 && atoi(words[3]) <= DRIVES, "prefix, channel, drives, period, commands");
  number = atoi(words[3]);
  commanded = atoi(words[5]);
  rcl_init_options_t options = rcl_get_zero_initialized_init_options();
  check(rcl_init_options_init(&options, rcl_get_default_allocator()) == RCL_RET_OK, "options");
  rcl_context_t context = rcl_get_zero_initialized_context();
  check(rcl_init(0, NULL, &options, &context) == RCL_RET_OK, "rcl_init");
  rcl_node_t node = rcl_get_zero_initialized_node();
  rcl_node_options_t node_options = rcl_node_get_default_options();
  node_options.enable_rosout = false;
  check(rcl_node_init(&node, "bench_c_floor", "", &context, &node_options) == RCL_RET_OK, "node");
  for (int drive = 0; drive < number; ++drive) {
    make(drive, &node, words[1]);
  }
  struct sockaddr_un address = {.sun_family = AF_UNIX};
  strncpy(address.sun_path, words[2], sizeof(address.sun_path) - 1);
  line = socket(AF_UNIX, SOCK_SEQPACKET, 0);
  check(connect(line, (struct sockaddr *)&address, sizeof(address)) == 0, words[2]);
  struct timeval timeout = {300, 0};     // PATIENCE of child.py
  setsockopt(line, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof(timeout));
  setvbuf(stdout, NULL, _IOLBF, 0);
  puts("true");
  double duration;
  while (scanf(" run %lf", &duration) == 1) {
    run(duration, (int64_t)(1e9 * atof(words[4])));
  }
  fflush(stdout);
  _exit(0);     // not Python's way out, nor the middleware's
}
