// SPDX-License-Identifier: GPL-3.0-or-later
// Test the link of the Unity sample with a real server: TestLink.exe PORT BASIS
using System;
using System.Diagnostics;
using System.Threading;
using Supine;
using UnityEngine;

static class TestLink
{
    static void Expect(bool holds, string what)
    {
        if (holds) return;
        Console.Error.WriteLine("failed: " + what);
        Environment.Exit(1);
    }

    static float Far(float[] a, float[] b)
    {
        Expect(a.Length == b.Length, "equal numbers of values");
        float most = 0;
        for (int i = 0; i < a.Length; ++i) most = Math.Max(most, Math.Abs(a[i] - b[i]));
        Expect(!float.IsNaN(most), "values are numbers");
        return most;
    }

    // Return six times the enclosed volume, positive if triangles face outwards in these axes.
    static double Volume(float[] p, int[] t)
    {
        double sum = 0;
        for (int i = 0; i < t.Length; i += 3)
        {
            int a = 3 * t[i], b = 3 * t[i + 1], c = 3 * t[i + 2];
            sum += p[a] * ((double)p[b + 1] * p[c + 2] - (double)p[b + 2] * p[c + 1])
                 + p[a + 1] * ((double)p[b + 2] * p[c] - (double)p[b] * p[c + 2])
                 + p[a + 2] * ((double)p[b] * p[c + 1] - (double)p[b + 1] * p[c]);
        }
        return sum;
    }

    static float[] Answer(Link link, ulong wanted)
    {
        Stopwatch clock = Stopwatch.StartNew();
        while (clock.ElapsedMilliseconds < 100000)
        {
            ulong stamp;
            float[] frame = link.TakeNewest(out stamp);
            if (frame != null && stamp == wanted) return frame;
            Expect(link.Failure == null, "the connection is open: " + link.Failure);
            Thread.Sleep(1);
        }
        Expect(false, "an answer arrives");
        return null;
    }

    static int Main(string[] words)
    {
        // Rotation matrices of `postures`, by rows. The columns are the directions of left, back and head in a room with z up.
        float[][] rotations = {
            new float[] { 1, 0, 0, 0, 0, 1, 0, -1, 0 },
            new float[] { -1, 0, 0, 0, 0, 1, 0, 1, 0 },
            new float[] { 0, -1, 0, 0, 0, 1, -1, 0, 0 },
            new float[] { 0, 1, 0, 0, 0, 1, 1, 0, 0 } };
        // Rotations that bring a standing Unity object into each of `postures`: 90 degrees about x or z; h = sin 45 = cos 45 degrees.
        const float h = 0.70710678f;
        Quaternion[] turns = { new Quaternion(-h, 0, 0, h), new Quaternion(h, 0, 0, h),
                               new Quaternion(0, 0, h, h), new Quaternion(0, 0, -h, h) };
        string[] postures = { "supine", "prone", "left", "right" };
        using (Basis basis = new Basis(words[1]))
        using (Link link = new Link("127.0.0.1", int.Parse(words[0])))
        {
            float[] rest = basis.Vertices();
            float[] xyz = new float[rest.Length];
            float[] before = new float[rest.Length];
            for (int i = 0; i < 4; ++i)
            {
                link.SendPose("Patient", LungBehaviour.Pose(turns[i]), (ulong)(90 + i));
                float[] turned = Answer(link, (ulong)(90 + i));
                link.SendPose("Patient", rotations[i], (ulong)(100 + i));
                float[] frame = Answer(link, (ulong)(100 + i));
                Expect(Far(turned, frame) < 1e-4f, "an object rotated to a posture gets the weights of the posture");
                Expect(Far(frame, basis.Frame(postures[i] + ":rest+400")) < 1e-4f, "weights and gains of the posture");
                basis.Deform(frame, xyz);
                Expect(Far(xyz, rest) > 1, "the lung moves");
                Expect(i == 0 || Far(xyz, before) > 0.5f, "shapes differ between postures");
                xyz.CopyTo(before, 0);
            }
            link.SetVolume("full");
            link.SendPose("Patient", rotations[0], 200);
            basis.Deform(Answer(link, 200), xyz);
            Expect(Far(xyz, rest) < 0.02f, "at full inflation the surface is that of the file");
            Expect(basis.Triangles().Length == 3 * basis.TriangleCount, "triangles");
            Expect(Volume(rest, basis.Triangles()) > 0, "triangles face outwards in right-handed axes");
            for (int i = 0; i < rest.Length; i += 3)
            {
                Vector3 p = LungBehaviour.ToUnity(rest[i], rest[i + 1], rest[i + 2]);
                xyz[i] = p.x;
                xyz[i + 1] = p.y;
                xyz[i + 2] = p.z;
            }
            Expect(Volume(xyz, LungBehaviour.ToUnity(basis.Triangles())) > 0, "triangles are clockwise from outside in left-handed axes");
        }
        return 0;
    }
}
