"""Builds songs with exact beats and downbeats that no training ever sees.

    python audio/reference/fresh_songs.py FOLDER FONT.sf2 [SHARE/SHARES]

FOLDER gets `dev/` (to tune on) and `report/` (to report; look seldom), each with
NAME.wav and NAME.beats (one line a beat: seconds, place in the bar from 1); songs with a
form also NAME.sections (one line a section: the second at which it begins).
With SHARE/SHARES (0/4) only every fourth song is made, for several processes; songs
that are there are left as they are. Sources, none of them our generator:

- tunes: public-domain melodies of PyPI's music21 (Ryan's Mammoth Collection,
  1883; folk songs), harmonised by the few lines below and accompanied by the grooves of
  MMA (Debian's `mma`), with its drums, basses and chords: swing, latin, rock,
  march, waltz, polka, 6/8, 5/4 and others;
- form: tunes of the same sources with an introduction, verses, choruses and a break, which
  differ in loudness, groove and instruments, in folders of their own: `form-dev/` and
  `form-report/`;
- scores: quartets, chorales, songs, a rag of music21, without drums;
- drums: the demo songs of Hydrogen (Debian's `hydrogen-data`);
- loops: CC0 recordings of Sonic Pi (Debian's `sonic-pi-samples`), repeated, at
  three speeds.

FONT must be one that training does not use. Needs music21, mido, numpy, soundfile,
scipy; programs mma and fluidsynth.
"""

import glob
import os
import random
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml

import mido
import numpy as np
import soundfile
from music21 import chord, converter, corpus, meter, note

RATE = 44100
LENGTH_S = 90.0

# Groove, beats a bar, whether three eighths are a beat, slowest and fastest tempo.
GROOVES = [
    ("March", 4, False, 104, 126), ("DixieMarch", 4, False, 100, 126), ("BWMarch", 4, False, 104, 124),
    ("68March", 2, True, 104, 126), ("Polka", 4, False, 112, 140), ("Waltz", 3, False, 96, 170),
    ("FrenchWaltz", 3, False, 120, 180), ("CountryWaltz", 3, False, 90, 130), ("VieneseWaltz", 3, False, 150, 190),
    ("JazzWaltz", 3, False, 120, 180), ("RockWaltz", 3, False, 96, 150), ("LatinWaltz", 3, False, 110, 150),
    ("Swing", 4, False, 120, 200), ("EasySwing", 4, False, 100, 140), ("FastSwing", 4, False, 170, 210),
    ("BigBand", 4, False, 120, 180), ("GypsyJazz", 4, False, 130, 200), ("Bebop", 4, False, 150, 210),
    ("SlowJazz", 4, False, 64, 96), ("NiteJazz", 4, False, 90, 140), ("ModernJazz", 4, False, 110, 170),
    ("Jazz54", 5, False, 120, 176), ("BossaNova", 4, False, 100, 150), ("Samba", 4, False, 90, 120),
    ("Salsa", 4, False, 150, 200), ("Mambo", 4, False, 140, 190), ("ChaCha", 4, False, 108, 128),
    ("Rhumba", 4, False, 100, 130), ("Beguine", 4, False, 96, 120), ("Merengue", 4, False, 120, 150),
    ("Tango", 4, False, 110, 132), ("Bolero", 4, False, 80, 110), ("Calypso", 4, False, 100, 130),
    ("AfroCuban", 4, False, 110, 150), ("Son", 4, False, 140, 180), ("BasicRock", 4, False, 96, 160),
    ("SoftRock", 4, False, 80, 130), ("60sRock", 4, False, 110, 160), ("50sRock", 4, False, 110, 160),
    ("RockBallad", 4, False, 64, 90), ("BubbleRock", 4, False, 110, 150), ("FolkRock", 4, False, 100, 140),
    ("8Beat", 4, False, 96, 150), ("Ska", 4, False, 120, 160), ("Trance", 4, False, 126, 140),
    ("ShuffleBoggie", 4, False, 110, 160), ("BoggieWoggie", 4, False, 130, 180), ("Blues", 4, False, 90, 140),
    ("Strut", 4, False, 96, 124), ("RB", 4, False, 90, 124), ("BVFunk", 4, False, 90, 116),
    ("PopBallad", 4, False, 64, 92), ("PianoBallad", 4, False, 60, 90), ("Folk", 4, False, 90, 130),
    ("Bluegrass", 4, False, 110, 150), ("CountryBlues", 4, False, 90, 130), ("WesternSwing", 4, False, 110, 160),
    ("Dixie", 4, False, 140, 200), ("Charleston", 4, False, 160, 210), ("Ragtime", 4, False, 90, 150),
    ("Foxtrot", 4, False, 110, 140), ("QuickStep", 4, False, 170, 208), ("Broadway", 4, False, 110, 150),
    ("Zydeco", 4, False, 110, 150), ("Hymn", 4, False, 70, 110), ("Twist", 4, False, 140, 170),
    ("68Swing", 2, True, 80, 120), ("Jive", 4, False, 150, 190), ("BonEyM", 4, False, 110, 130),
]
LEADS = [0, 4, 11, 22, 25, 26, 40, 56, 61, 64, 65, 66, 71, 73, 80, 21]
SCORES = [
    ("bach/bwv66.6", 84), ("bach/bwv269", 76), ("bach/bwv846", 72), ("beethoven/opus18no1", 120),
    ("beethoven/opus18no3", 120), ("beethoven/opus18no4", 120), ("beethoven/opus59no2", 112),
    ("beethoven/opus74", 112), ("haydn/opus1no1", 104), ("haydn/opus33no1", 116), ("haydn/opus74no1", 120),
    ("haydn/opus17no1", 108), ("mozart/k80", 100), ("mozart/k155", 126), ("mozart/k156", 120), ("mozart/k458", 126),
    ("joplin/maple_leaf_rag", 92), ("schumann_robert/opus41no1", 108), ("handel/rinaldo/lascia_chio_pianga", 66),
    ("corelli/opus3no1", 92), ("weber/doppelFuge", 100), ("liliuokalani/aloha_oe", 84),
]
# Grooves of a verse and of a chorus.
FORMS = [
    ("8Beat", "8Beat1Plus"), ("SoftRock1", "SoftRock2"), ("60sRock1", "60sRockPlus"), ("BasicRockSus", "BasicRock4"),
    ("R&BSus", "R&BPlus"), ("SalsaSus", "SalsaPlus"), ("Ska1Sus", "SkaClap"), ("Samba", "SambaSusPlus"),
    ("Trance", "Trance2Bass1"), ("8BeatWalk", "8BeatSusPlus"), ("SoftRock", "SoftRock2Sus"), ("60sRock", "60sRock1Plus"),
]
# Bars and loudness of the parts of a song, and which channels play in them.
PARTS = {
    "introduction": (4, 0.5, lambda channel: channel != 9),
    "verse": (8, 0.7, lambda channel: True),
    "chorus": (8, 1.0, lambda channel: True),
    "break": (4, 0.45, lambda channel: channel == 9),
    "quiet": (4, 0.4, lambda channel: channel != 9),
}
ORDERS = [
    ["introduction", "verse", "chorus", "break", "verse", "chorus", "quiet", "chorus"],
    ["verse", "chorus", "quiet", "verse", "chorus", "break", "chorus", "chorus"],
    ["chorus", "verse", "break", "chorus", "quiet", "verse", "chorus", "verse"],
]
# Beats of each loop.
LOOPS = {"amen": 4, "amen_full": 16, "breakbeat": 4, "compus": 16, "electric": 4, "garzul": 16, "industrial": 2,
         "mehackit1": 4, "mehackit2": 4, "mika": 16, "safari": 16}


def render(events, programs, font, wet):
    """events: (start s, length s, channel, key, velocity)."""
    with tempfile.TemporaryDirectory() as folder:
        file = mido.MidiFile(ticks_per_beat=960)
        track = mido.MidiTrack()
        file.tracks.append(track)
        messages = [(0, 0, mido.Message("program_change", channel=c, program=p)) for c, p in programs.items()]
        for start, length, channel, key, velocity in events:
            tick, end = round(start * 1920), round((start + max(length, 0.03)) * 1920)
            messages.append((tick, 2, mido.Message("note_on", channel=channel, note=key, velocity=velocity)))
            messages.append((end, 1, mido.Message("note_off", channel=channel, note=key)))
        now = 0
        for tick, _, message in sorted(messages, key=lambda m: m[:2]):
            track.append(message.copy(time=tick - now))
            now = tick
        file.save(f"{folder}/score.mid")
        command = ["fluidsynth", "-niq", "-R", wet, "-C", wet, "-g", "0.4", "-r", str(RATE), "-F", f"{folder}/s.wav",
                   "-o", "synth.dynamic-sample-loading=1", font, f"{folder}/score.mid"]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
        sound, _ = soundfile.read(f"{folder}/s.wav")
        return sound.mean(axis=1)


def melody(score):
    """Notes of a tune by whole bars: (bar, quarters from its beginning, length, key)."""
    part = score.parts[0] if score.parts else score
    out, bars = [], [m for m in part.getElementsByClass("Measure") if m.barDuration.quarterLength == m.duration.quarterLength]
    for index, bar in enumerate(bars):
        for n in bar.notes:
            key = n.pitches[-1].midi if isinstance(n, chord.Chord) else n.pitch.midi
            out.append((index, float(n.offset), float(n.quarterLength), key))
    return out, len(bars)


def harmonise(notes, bars, key):
    """One of six chords a bar, the one that most of the melody belongs to."""
    tonic, minor = key.tonic.pitchClass, key.mode == "minor"
    chords = [(0, "m"), (5, "m"), (7, "7"), (3, ""), (8, ""), (10, "")] if minor else \
             [(0, ""), (5, ""), (7, "7"), (9, "m"), (2, "m"), (4, "m")]
    names = "C Db D Eb E F Gb G Ab A Bb B".split()
    out = []
    for bar in range(bars):
        def fit(item):
            index, (root, kind) = item
            third = 3 if kind == "m" else 4
            tones = {(tonic + root + t) % 12 for t in (0, third, 7)}
            inside = sum(l for b, _, l, k in notes if b == bar and k % 12 in tones)
            return inside - 0.15 * index
        root, kind = max(enumerate(chords), key=fit)[1]
        out.append(names[(tonic + root) % 12] + kind)
    return out


def accompaniment(grooves, chords, tempo, seed):
    """Events and programs of MMA's band; a groove for each chord."""
    with tempfile.TemporaryDirectory() as folder:
        lines, last = [f"RndSeed {seed}", f"Tempo {tempo}"], None
        for bar, (groove, name) in enumerate(zip(grooves, chords)):
            lines += [f"Groove {groove}"] if groove != last else []
            lines.append(f"{bar + 1} {name}")
            last = groove
        open(f"{folder}/a.mma", "w").write("\n".join(lines) + "\n")
        subprocess.run(["mma", f"{folder}/a.mma", "-f", f"{folder}/a.mid"], check=True, capture_output=True)
        events, programs, open_notes, now = [], {}, {}, 0.0
        for message in mido.MidiFile(f"{folder}/a.mid"):
            now += message.time
            if message.type == "program_change":
                programs.setdefault(message.channel, message.program)
            if message.type == "note_on" and message.velocity > 0:
                open_notes[message.channel, message.note] = (now, message.velocity)
            elif message.type in ("note_off", "note_on"):
                begun = open_notes.pop((message.channel, message.note), None)
                if begun:
                    events.append((begun[0], now - begun[0], message.channel, message.note, begun[1]))
        return events, programs


def tune_song(groove, tune, font, rng):
    name, beats, compound, low, high = groove
    notes, bars = melody(tune)
    key = tune.analyze("key")
    chords = harmonise(notes, bars, key)
    tempo = round(rng.uniform(low, high))  # MMA knows whole tempi only
    beat_s, quarters = 60.0 / tempo, 1.5 if compound else 1.0
    turns = int(LENGTH_S / (bars * beats * beat_s)) + 1
    events, programs = accompaniment([name] * (bars * turns), chords * turns, tempo, rng.randrange(999))
    # A quarter in 2/4 tunes is half a beat of the band's bar of four.
    bar_quarters = tune.recurse().getElementsByClass(meter.TimeSignature)[0].barDuration.quarterLength
    stretch = beats * quarters / bar_quarters / quarters
    lead = rng.choice([c for c in range(16) if c not in programs and c != 9])
    programs[lead] = rng.choice(LEADS)
    up = rng.choice([0, 0, 12, -12])
    for turn in range(turns):
        if turn and rng.random() < 0.25:
            continue
        for bar, at, length, pitch in notes:
            start = ((turn * bars + bar) * beats + at * stretch / (1 if not compound else 1)) * beat_s
            events.append((start, 0.95 * length * stretch * beat_s, lead, pitch + up, rng.randrange(76, 110)))
    sound = render(events, programs, font, rng.choice("01"))
    count = int(len(sound) / RATE / beat_s)
    return sound, [(i * beat_s, i % beats + 1) for i in range(count)]


def form_song(index, grooves, tune, font, rng):
    """A song of parts; also the seconds at which they begin."""
    notes, bars = melody(tune)
    chords = harmonise(notes, bars, tune.analyze("key"))
    tempo = rng.randrange(96, 150)
    beat_s = 60.0 / tempo
    parts = [name for name in ORDERS[index % len(ORDERS)] for _ in range(PARTS[name][0])]
    played = [grooves[name == "chorus"] for name in parts]
    every, programs = accompaniment(played, [chords[bar % bars] for bar in range(len(parts))], tempo, rng.randrange(999))
    part_at = lambda start: parts[min(int((start + 0.02) / (4 * beat_s)), len(parts) - 1)]
    events = [e for e in every if PARTS[part_at(e[0])][2](e[2])]
    free = [c for c in range(16) if c not in programs and c != 9][:2]
    programs |= {channel: rng.choice(LEADS) for channel in free}
    quarters = tune.recurse().getElementsByClass(meter.TimeSignature)[0].barDuration.quarterLength
    for bar, name in enumerate(parts):
        if name in ("introduction", "break"):
            continue
        for _, at, length, pitch in (n for n in notes if n[0] == bar % bars):
            start, long_s = (bar * 4 + at * 4 / quarters) * beat_s, 0.95 * length * 4 / quarters * beat_s
            events.append((start, long_s, free[name == "chorus"], pitch, rng.randrange(76, 110)))
    events = [(t, l, c, k, max(1, int(v * PARTS[part_at(t)][1]))) for t, l, c, k, v in events]
    sound = render(events, programs, font, rng.choice("01"))
    begins = [bar for bar in range(1, len(parts)) if parts[bar] != parts[bar - 1]]
    beats = [(i * beat_s, i % 4 + 1) for i in range(int(len(sound) / RATE / beat_s))]
    return sound, beats, [bar * 4 * beat_s for bar in begins]


def score_song(path, tempo, font, rng):
    score = corpus.parse(path)
    signature = score.recurse().getElementsByClass(meter.TimeSignature)[0]
    quarter_s = 60.0 / tempo / (1.0 if signature.denominator >= 4 else 2.0)
    if signature.numerator in (6, 9, 12) and signature.denominator == 8:
        quarter_s /= 1.5
    events, programs, truth = [], {}, {}
    for index, part in enumerate(score.parts):
        channel = index if index < 9 else index + 1
        programs[channel] = {"joplin": 0}.get(path.split("/")[0], rng.choice([48, 40, 42, 71, 73, 0]) if "bach" in path else 48)
        for element in part.flatten().notes:
            pitches = [p.midi for p in element.pitches]
            start, length = float(element.offset) * quarter_s, float(element.quarterLength) * quarter_s
            if start < LENGTH_S and length > 0:
                events += [(start, 0.95 * length, channel % 16, p, rng.randrange(70, 100)) for p in pitches]
    signature = None
    for bar in score.parts[0].getElementsByClass("Measure"):
        signature = bar.timeSignature or signature
        unit = float(signature.beatDuration.quarterLength)
        length = float(bar.duration.quarterLength)
        full = float(signature.barDuration.quarterLength)
        missing = full - length if bar.offset == 0 and length < full else 0.0
        at = 0.0
        while at < length - 1e-6:
            place = (at + missing) / unit
            if abs(place - round(place)) < 1e-6:
                truth[(float(bar.offset) + at) * quarter_s] = int(round(place)) + 1
            at += 0.25
    sound = render(events, programs, font, "1")
    return sound, sorted(truth.items())


def hydrogen_song(path, font):
    song = xml.parse(path).getroot()
    plain = lambda e: e.tag.split("}")[-1]
    for element in song.iter():
        element.tag = plain(element)
    beat_s = 60.0 / float(song.findtext("bpm"))
    keys = {}
    for i in song.find("instrumentList"):
        text = i.findtext("name").lower()
        table = [("kick", 36), ("stick", 37), ("snare", 38), ("clap", 39), ("tom low", 41), ("tom", 45), ("open", 46),
                 ("pedal", 44), ("hh", 42), ("hat", 42), ("cowbell", 56), ("crash", 49), ("ride", 51), ("shaker", 70)]
        keys[i.findtext("id")] = next((k for word, k in table if word in text), 37)
    patterns = {p.findtext("name"): p for p in song.find("patternList")}
    events, truth, tick = [], [], 0
    groups = [[g.text for g in group] for group in song.find("patternSequence") if len(group)]
    while tick / 48 * beat_s < LENGTH_S:
        for names in groups:
            size = max(int(patterns[n].findtext("size")) for n in names)
            for n in names:
                for stroke in patterns[n].iter("note"):
                    at = (tick + int(stroke.findtext("position"))) / 48 * beat_s
                    velocity = int(30 + 97 * float(stroke.findtext("velocity")))
                    events.append((at, 0.1, 9, keys.get(stroke.findtext("instrument"), 37), min(velocity, 127)))
            truth += [((tick + 48 * b) / 48 * beat_s, b % 4 + 1) for b in range(size // 48)]
            tick += size
    return render([e for e in events if e[0] < LENGTH_S], {9: 0}, font, "1"), truth


def loop_song(path, beats, speed):
    from scipy.signal import resample

    sound, rate = soundfile.read(path)
    sound = sound.mean(axis=1) if sound.ndim > 1 else sound
    length_s = len(sound) / rate / speed
    sound = resample(sound, int(round(length_s * RATE)))
    length_s = len(sound) / RATE
    turns = int(LENGTH_S / length_s)
    truth = [(i * length_s / beats, i % 4 + 1 if beats % 4 == 0 else i % 2 + 1) for i in range(turns * beats)]
    return np.tile(sound, turns), truth


def tunes_in(kinds, name, count, rng):
    """So many tunes of a collection in one of the meters."""
    texts = []
    for path in sorted(p for p in corpus.getCorePaths() if name in str(p) and str(p).endswith(".abc")):
        for text in ("\n" + open(path, errors="replace").read()).split("\nX:")[1:]:
            found = re.search(r"^M: ?(\S+)", text, re.M)
            if found and found.group(1) in kinds and 350 < len(text) < 1500:
                texts.append("X:" + text)
    rng.shuffle(texts)
    out = []
    for text in texts:
        tune = converter.parse(text, format="abc")
        if 8 <= len(tune.recurse().getElementsByClass("Measure")) <= 80:
            out.append(tune)
        if len(out) == count:
            break
    return out


def songs(font):
    rng = random.Random(7)
    tunes = {"4": tunes_in(["4/4", "2/4", "C", "C|", "2/2"], "ryansMammoth", 24, rng),
             "6": tunes_in(["6/8"], "ryansMammoth", 4, rng), "3": tunes_in(["3/4"], "essenFolksong", 8, rng)}
    for index, groove in enumerate(GROOVES):
        kind = "6" if groove[2] else "3" if groove[1] == 3 else "4"
        if tunes[kind]:
            yield f"tune_{groove[0]}", lambda rng, g=groove, t=tunes[kind][index % len(tunes[kind])]: tune_song(g, t, font, rng)
    for index in range(2 * len(FORMS)):
        grooves, tune = FORMS[index % len(FORMS)], tunes["4"][(index * 7 + 3) % len(tunes["4"])]
        name = f"form_{grooves[0]}_{index // len(FORMS)}".replace("&", "")
        yield name, lambda rng, i=index, g=grooves, t=tune: form_song(i, g, t, font, rng)
    for path, tempo in SCORES:
        yield "score_" + path.replace("/", "_"), lambda rng, p=path, t=tempo: score_song(p, t, font, rng)
    for path in sorted(glob.glob("/usr/share/hydrogen/data/demo_songs/*.h2song")):
        yield "drums_" + os.path.basename(path)[:-7], lambda rng, p=path: hydrogen_song(p, font)
    for index, (name, beats) in enumerate(LOOPS.items()):
        speed = [1.0, 0.88, 1.1][index % 3]
        yield "loop_" + name, lambda rng, n=name, b=beats, s=speed: loop_song(f"/usr/share/sonic-pi/samples/loop_{n}.flac", b, s)


def main():
    folder, font = sys.argv[1:3]
    share, shares = map(int, sys.argv[3].split("/")) if len(sys.argv) > 3 else (0, 1)
    for part in ("dev", "report", "form-dev", "form-report"):
        os.makedirs(f"{folder}/{part}", exist_ok=True)
    # Songs with a form are counted apart, so that the others stay in their folders.
    made = list(songs(font))
    forms = [song for song in made if song[0].startswith("form_")]
    plain = [song for song in made if not song[0].startswith("form_")]
    places = [(song, "report" if index % 3 else "dev") for index, song in enumerate(plain)]
    places += [(song, "form-report" if index % 2 else "form-dev") for index, song in enumerate(forms)]
    for index, ((name, make), part) in enumerate(places):
        path = f"{folder}/{part}/{name}"
        if index % shares != share or os.path.exists(path + ".beats"):
            continue
        rng = random.Random(name)
        cut_s = rng.choice([0.0, rng.uniform(0.0, 3.0)])
        try:
            sound, truth, *form = make(rng)
        except Exception as error:
            print("left out:", name, repr(error)[:200], flush=True)
            continue
        sound = sound[int(cut_s * RATE): int((cut_s + LENGTH_S) * RATE)]
        sound = sound / (np.abs(sound).max() + 1e-9) * 10 ** (rng.uniform(-12, -1) / 20)
        truth = [(t - cut_s, place) for t, place in truth if cut_s <= t < cut_s + len(sound) / RATE]
        soundfile.write(path + ".wav", sound, RATE, subtype="PCM_16")
        with open(path + ".beats", "w") as out:
            out.writelines(f"{t:.4f} {place}\n" for t, place in truth)
        for sections in form:
            times_s = [t - cut_s for t in sections if cut_s <= t < cut_s + len(sound) / RATE]
            open(path + ".sections", "w").writelines(f"{t:.4f}\n" for t in times_s)
        print(path, len(truth), flush=True)


if __name__ == "__main__":
    main()
