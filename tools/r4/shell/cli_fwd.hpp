// SPDX-License-Identifier: GPL-3.0-or-later
// Forward declarations of CLI11: its headers take longer to compile than most subcommands.
#pragma once

namespace CLI {  // NOLINT(readability-identifier-naming): not our name
class App;
class Option;
}  // namespace CLI
