// SPDX-License-Identifier: GPL-3.0-or-later
// The subcommands of r4, one file each. add_…() declares a subcommand below `root`. Parsing the
// command line stores the action in `chosen`. The action returns the exit code or throws Error.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "cli_fwd.hpp"

namespace r4::tool {

using Action = std::function<int()>;

void add_sim(CLI::App& root, Action& chosen);
void add_monitor(CLI::App& root, Action& chosen);
void add_send(CLI::App& root, Action& chosen);
void add_stop(CLI::App& root, Action& chosen);
void add_list(CLI::App& root, Action& chosen);
void add_devices(CLI::App& root, Action& chosen);
void add_encode(CLI::App& root, Action& chosen);
void add_decode(CLI::App& root, Action& chosen);
void add_doctor(CLI::App& root, Action& chosen);
void add_bridge(CLI::App& root, Action& chosen);
void add_bus(CLI::App& root, Action& chosen);
void add_bench(CLI::App& root, Action& chosen);
void add_record(CLI::App& root, Action& chosen);
void add_metrics(CLI::App& root, Action& chosen);
void add_web(CLI::App& root, Action& chosen);
void add_ros2(CLI::App& root, Action& chosen);
void add_replay(CLI::App& root, Action& chosen);
void add_info(CLI::App& root, Action& chosen);
void add_convert(CLI::App& root, Action& chosen);
void add_plot(CLI::App& root, Action& chosen);
void add_upload(CLI::App& root, Action& chosen);
void add_key_command(CLI::App& root, Action& chosen);
void add_wiring(CLI::App& root, Action& chosen);
void add_commission(CLI::App& root, Action& chosen);
void add_demo(CLI::App& root, Action& chosen);
void add_completion(CLI::App& root, Action& chosen);
void add_man(CLI::App& root, Action& chosen);

CLI::App* add_subcommand(CLI::App& root, const char* name, const char* meaning,
                         const std::string& footer, std::function<void()> on_chosen);

template <class Options>
CLI::App* add_subcommand(CLI::App& root, Action& chosen, const char* name, const char* meaning,
                         const std::string& footer, std::shared_ptr<Options> options,
                         int (*action)(const Options&)) {
  return add_subcommand(root, name, meaning, footer, [&chosen, options, action] {
    chosen = [options, action] { return action(*options); };
  });
}

}  // namespace r4::tool
