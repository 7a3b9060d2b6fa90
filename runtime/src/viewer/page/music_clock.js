// Which moment of the music it is now. Frames come more or less late, and a robot on a busy
// computer falls behind; the two are told apart by the server's clock, which each frame has.

// The frame that came least late tells how the server's clock differs from this page's.
const CLOCKS_S = 30;
// A cycle that is late is made up for, or the music is late from then on.
const MUSIC_S = 1.5;
// The music stands still, or nobody tells of it.
const STILL_S = 0.5;
const ENOUGH = 5;

export function makeMusicClock() {
  // How far the server's clock, and on it the music, are ahead; each with its age.
  let clocks = [];
  let leads = [];
  let last = { music_s: NaN, now_s: -Infinity };
  const kept = (values, now_s, for_s) => values.filter((value) => value.now_s > now_s - for_s);
  const most = (values) => Math.max(...values.map(({ ahead_s }) => ahead_s));

  return {
    hear(frame, now_s) {
      clocks = [...kept(clocks, now_s, CLOCKS_S), { now_s, ahead_s: frame.clock_s - now_s }];
      if (frame.music_s === last.music_s) return;
      if (now_s - last.now_s > STILL_S) leads = [];
      last = { music_s: frame.music_s, now_s };
      const ahead_s = frame.music_s + frame.age_s - frame.clock_s;
      leads = [...kept(leads, now_s, MUSIC_S), { now_s, ahead_s }];
    },
    // Seconds of music, or null while it does not run.
    at(now_s) {
      if (leads.length < ENOUGH || now_s - last.now_s > STILL_S) return null;
      return now_s + most(clocks) + most(leads);
    },
  };
}
