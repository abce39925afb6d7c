// SPDX-License-Identifier: GPL-3.0-or-later
// Names of CLI11, for those who do not need its headers: they take longer to compile than most of
// the subcommands themselves.
#pragma once

namespace CLI {  // NOLINT(readability-identifier-naming): not our name
class App;
class Option;
}  // namespace CLI
