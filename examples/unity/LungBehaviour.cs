// SPDX-License-Identifier: MIT
// Shows the lungs in a Unity scene. Add this script to an object with a MeshFilter, and set the basis file.
// The object is the patient: the lungs deform whenever its rotation changes. Set a host to follow 'supine
// stream' there, to which the rotation is sent; without one, everything is computed here. Unity's axes are
// left-handed, in metres, y up. An object without rotation is a standing patient who faces +z, with left,
// back and head at -x, -z and +y.
using UnityEngine;
using UnityEngine.Rendering;

public class LungBehaviour : MonoBehaviour
{
    public string basisFile = "lungs.safetensors";
    public string volume = "rest+500"; // without a host
    public string host = "";
    public int port = 18944;
    Supine.Basis basis;
    Supine.Link link;
    float[] xyz, normals;
    Vector3[] points, directions;
    Mesh mesh;
    ulong sent;

    static readonly double[] up = { 0, 1, 0 };

    public static Vector3 ToUnity(float left, float back, float head, float scale)
    {
        return new Vector3(-scale * left, scale * head, -scale * back);
    }

    /// <summary>Reverses triangles in place, so that they face outwards in left-handed axes.</summary>
    public static int[] ToUnity(int[] corners)
    {
        for (int i = 0; i < corners.Length; i += 3)
        {
            int second = corners[i + 1];
            corners[i + 1] = corners[i + 2];
            corners[i + 2] = second;
        }
        return corners;
    }

    /// <summary>Converts a rotation to the row-major matrix from body axes (LPS) to world axes, z up.</summary>
    public static float[] Pose(Quaternion rotation)
    {
        Vector3[] axes = { rotation * new Vector3(-1, 0, 0), rotation * new Vector3(0, 0, -1),
                           rotation * new Vector3(0, 1, 0) };
        float[] rows = new float[9];
        for (int column = 0; column < 3; ++column)
        {
            rows[column] = -axes[column].x;
            rows[3 + column] = -axes[column].z;
            rows[6 + column] = axes[column].y;
        }
        return rows;
    }

    void Start()
    {
        basis = new Supine.Basis(basisFile);
        if (host != "") link = new Supine.Link(host, port);
        xyz = new float[3 * basis.VertexCount];
        normals = new float[3 * basis.VertexCount];
        points = new Vector3[basis.VertexCount];
        directions = new Vector3[basis.VertexCount];
        mesh = new Mesh();
        mesh.indexFormat = IndexFormat.UInt32;
        mesh.MarkDynamic();
        Show(); // the surface of the file, before the first pose
        mesh.triangles = ToUnity(basis.Triangles());
        GetComponent<MeshFilter>().mesh = mesh;
        transform.hasChanged = true;
    }

    void Update()
    {
        bool turned = transform.hasChanged;
        transform.hasChanged = false;
        if (link == null)
        {
            if (!turned) return;
            Quaternion q = transform.rotation;
            basis.Pose(basis.Gravity(new double[] { q.w, q.x, q.y, q.z }, up, "unity"), volume);
        }
        else
        {
            if (turned) link.SendPose("Patient", Pose(transform.rotation), ++sent);
            ulong stamp;
            float[] frame = link.TakeNewest(out stamp);
            if (frame == null) return;
            basis.Pose(frame);
        }
        Show();
    }

    void Show()
    {
        basis.Deform(xyz, normals);
        for (int i = 0; i < points.Length; ++i)
        {
            points[i] = ToUnity(xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2], 1e-3f);
            directions[i] = ToUnity(normals[3 * i], normals[3 * i + 1], normals[3 * i + 2], 1);
        }
        mesh.vertices = points;
        mesh.normals = directions;
    }

    void OnDestroy()
    {
        if (link != null) link.Dispose();
        if (basis != null) basis.Dispose();
    }
}
