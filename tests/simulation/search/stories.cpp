// SPDX-License-Identifier: GPL-3.0-or-later
#include "story.hpp"

namespace r4::simulation {
namespace {

using Kind = Act::Kind;

// A host is in control after 200 ms. The host sends heartbeats every 250 ms. The board sends
// heartbeats every 500 ms, and states every 200 ms.
std::vector<Story> all() {
  std::vector<Story> all;
  const auto add = [&all](const char* name, const char* text, std::uint32_t faults_until_ms,
                          std::vector<Act> acts) -> Story& {
    Story story;
    story.name = name;
    story.text = text;
    story.acts = std::move(acts);
    story.faults_until_ms = faults_until_ms;
    all.push_back(std::move(story));
    return all.back();
  };

  add("begin", "a host connects and drives", 350, {{0, Kind::start}, {250, Kind::command}})
      .is_short = true;

  add("end", "a host drives and says farewell", 400,
      {{0, Kind::start}, {250, Kind::command}, {330, Kind::leave}})
      .is_short = true;

  add("drive", "a host drives, stops the board, commands in vain, clears the stop and drives on",
      950,
      {{0, Kind::start},
       {250, Kind::command},
       {350, Kind::group},
       {550, Kind::stop},
       {600, Kind::command},
       {700, Kind::clear},
       {820, Kind::command}});

  add("killed", "a host drives and is killed", 1800,
      {{0, Kind::start}, {250, Kind::command}, {550, Kind::kill}});

  add("restart", "a host drives, is killed and restarts at once, and drives", 2000,
      {{0, Kind::start},
       {250, Kind::command},
       {550, Kind::kill},
       {600, Kind::start},
       {1900, Kind::command}});

  add("farewell", "a host drives and says farewell; a second host takes control and drives", 1000,
      {{0, Kind::start},
       {250, Kind::command},
       {400, Kind::leave},
       {500, Kind::start, 1},
       {900, Kind::command, 1}})
      .hosts = 2;

  add("waiting", "a host drives while a second one waits; the first is killed, the second drives",
      1900,
      {{0, Kind::start},
       {100, Kind::start, 1},
       {250, Kind::command},
       {400, Kind::kill},
       {1850, Kind::command, 1}})
      .hosts = 2;

  add("watched", "a host drives while a program watches, and is killed", 1700,
      {{0, Kind::start}, {10, Kind::start, 2}, {250, Kind::command}, {550, Kind::kill}})
      .watched = true;

  {
    Story& story =
        add("two paths", "a host drives over two paths, of which one carries nothing for a while",
            900, {{0, Kind::start}, {400, Kind::command}, {600, Kind::cut, 0}, {750, Kind::group}});
    story.paths = 2;
  }
  {
    Story& story = add("two paths at one port",
                       "a host drives over two paths to one port of the board, and is killed", 1700,
                       {{0, Kind::start}, {400, Kind::command}, {650, Kind::kill}});
    story.paths = 2;
    story.one_port = true;
  }
  {
    Story& story =
        add("cable",
            "a host drives over the board's cable alone, and is killed; strangers are on "
            "the board's network",
            1700, {{0, Kind::start}, {250, Kind::command}, {550, Kind::kill}});
    story.paths = 2;
    story.paths_of_first = 1;
  }

  add("reboot", "a host drives, the board restarts, the host drives on", 1000,
      {{0, Kind::start}, {250, Kind::command}, {450, Kind::reboot}, {900, Kind::command}});

  add("sleep", "a host drives, its computer sleeps, it drives on", 2400,
      {{0, Kind::start}, {250, Kind::command}, {450, Kind::sleep}, {2300, Kind::command}});

  add("key", "a host with a key drives and is killed", 1800,
      {{0, Kind::start}, {300, Kind::command}, {550, Kind::kill}})
      .keys = true;

  {
    Story& story =
        add("key and two paths", "a host with a key drives over two paths, and is killed", 1800,
            {{0, Kind::start}, {500, Kind::command}, {750, Kind::kill}});
    story.keys = true;
    story.paths = 2;
  }

  add("bridge", "a host drives over a bridge, and is killed", 1800,
      {{0, Kind::start}, {250, Kind::command}, {550, Kind::kill}})
      .bridge = true;

  {
    Story& story =
        add("bridge watched",
            "a host drives over a bridge while a program watches over it, and is killed", 1600,
            {{0, Kind::start}, {10, Kind::start, 2}, {250, Kind::command}, {550, Kind::kill}});
    story.bridge = true;
    story.watched = true;
  }
  {
    Story& story = add("bridge for two",
                       "a host drives over a bridge while a second one waits; it is killed, the "
                       "second drives",
                       1900,
                       {{0, Kind::start},
                        {100, Kind::start, 1},
                        {250, Kind::command},
                        {400, Kind::kill},
                        {1850, Kind::command, 1}});
    story.bridge = true;
    story.hosts = 2;
  }
  {
    Story& story =
        add("one address",
            "two hosts reach the board from one address; the first drives and is killed, "
            "the second drives",
            1000,
            {{0, Kind::start},
             {100, Kind::start, 1},
             {250, Kind::command},
             {400, Kind::kill},
             {1850, Kind::command, 1}});
    story.one_address = true;
    story.hosts = 2;
  }
  return all;
}

}  // namespace

const std::vector<Story>& stories() {
  static const std::vector<Story> list = all();
  return list;
}

}  // namespace r4::simulation
