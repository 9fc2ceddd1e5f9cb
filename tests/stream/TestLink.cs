// SPDX-License-Identifier: GPL-3.0-or-later
// The Unity sample's link against a real server: TestLink.exe PORT BASIS
using System;
using System.Diagnostics;
using System.Threading;
using Supine;

static class TestLink
{
    static void Expect(bool holds, string what)
    {
        if (holds) return;
        Console.Error.WriteLine("not so: " + what);
        Environment.Exit(1);
    }

    static float Far(float[] a, float[] b)
    {
        Expect(a.Length == b.Length, "as many numbers");
        float most = 0;
        for (int i = 0; i < a.Length; ++i) most = Math.Max(most, Math.Abs(a[i] - b[i]));
        Expect(!float.IsNaN(most), "finite numbers");
        return most;
    }

    static float[] Answer(Link link, ulong wanted)
    {
        Stopwatch clock = Stopwatch.StartNew();
        while (clock.ElapsedMilliseconds < 10000)
        {
            ulong stamp;
            float[] frame = link.TakeNewest(out stamp);
            if (frame != null && stamp == wanted) return frame;
            Expect(link.Failure == null, "the link holds: " + link.Failure);
            Thread.Sleep(1);
        }
        Expect(false, "an answer comes");
        return null;
    }

    static int Main(string[] words)
    {
        // Rows; columns: where left, back and head point in a room whose z is up.
        float[][] rotations = {
            new float[] { 1, 0, 0, 0, 0, 1, 0, -1, 0 },
            new float[] { -1, 0, 0, 0, 0, 1, 0, 1, 0 },
            new float[] { 0, -1, 0, 0, 0, 1, -1, 0, 0 },
            new float[] { 0, 1, 0, 0, 0, 1, 1, 0, 0 } };
        string[] postures = { "supine", "prone", "left", "right" };
        using (Basis basis = new Basis(words[1]))
        using (Link link = new Link("127.0.0.1", int.Parse(words[0])))
        {
            float[] rest = basis.Vertices();
            float[] xyz = new float[rest.Length];
            float[] before = new float[rest.Length];
            for (int i = 0; i < 4; ++i)
            {
                link.SendPose("Patient", rotations[i], (ulong)(100 + i));
                float[] frame = Answer(link, (ulong)(100 + i));
                Expect(Far(frame, basis.Frame(postures[i] + ":rest+400")) < 1e-4f, "weights and gains of the posture");
                basis.Deform(frame, xyz);
                Expect(Far(xyz, rest) > 1, "the lung moves");
                Expect(i == 0 || Far(xyz, before) > 0.5f, "another posture, another shape");
                xyz.CopyTo(before, 0);
            }
            link.SetVolume("full");
            link.SendPose("Patient", rotations[0], 200);
            basis.Deform(Answer(link, 200), xyz);
            Expect(Far(xyz, rest) < 0.02f, "full, the lung is the file's, as stored");
            Expect(basis.Triangles().Length == 3 * basis.TriangleCount, "triangles");
        }
        return 0;
    }
}
